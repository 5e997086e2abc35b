"""What the demonstration made, as the JSON object of the command and as lines for a person."""

from pathlib import Path
from typing import Any

import numpy as np

from daq.counted import counted
from processing.analysis.estimates import Estimate
from server.demo.demo import Demonstration
from server.demo.demo_answers import spray_answers
from server.demo.demo_droplets import COUNTED_UM, MeasuredDroplets
from server.demo.demo_liquid import MeasuredLiquid


def summary(demo: Demonstration, report: Path) -> dict[str, Any]:
    """The JSON object of the command."""
    return {
        "shots_planned": demo.shots_planned,
        "shots_recorded": demo.shots_recorded,
        "shots_valid": demo.shots_valid,
        "views": {
            name: {
                "mean_error_px": view.mean_error_px,
                "holdout_error_px": view.holdout_error_px,
                "true_error_px": demo.true_error_px[name],
                "verdict": view.verdict.value,
            }
            for name, view in demo.calibration.views.items()
        },
        "quality_factor": float(np.mean(demo.quality_factors)),
        "droplets": _measured(demo.droplets),
        "liquid": _liquid(demo.liquid),
        "spray": {name: _answer(*pair) for name, pair in spray_answers(demo.droplets.truth, demo.spray).items()},
        "seconds": demo.seconds,
        "report": str(report),
    }


def _answer(told: Estimate | None, true: Estimate | None) -> dict[str, Any]:
    return {"measured": told and told.model_dump(mode="json"), "true": true and true.value}


def _measured(droplets: MeasuredDroplets) -> dict[str, Any]:
    d32_um = droplets.statistics.d32_um
    return {
        **droplets.shot.model_dump(mode="json", exclude={"file"}),
        "counted_from_um": COUNTED_UM,
        "found_share": droplets.found_share,
        "true_ghost_share": droplets.ghost_share,
        "reasons": reasons_of(droplets),
        "d32_um": None if d32_um is None else d32_um.model_dump(mode="json"),
        "true_d32_um": droplets.true_d32_um,
        "velocity_rms_m_s": droplets.velocities and droplets.velocities.rms_m_s,
        "true_velocity_m_s": droplets.velocities and droplets.velocities.true_mean_m_s,
        "file": str(droplets.file),
    }


def reasons_of(droplets: MeasuredDroplets) -> list[str]:
    """Why the shot is not good, or has no D32."""
    statistics = droplets.statistics
    return [*droplets.shot.reasons, *([statistics.reason] if statistics.reason and statistics.d32_um is None else [])]


def readable_summary(result: dict[str, Any]) -> str:
    """The same for a person."""
    lines = [f"{result['shots_valid']} of {counted(result['shots_planned'], 'shot')} valid", ""]
    lines.append(f"{'view':8}{'mean error':>12}{'hold-out':>12}{'true error':>12}  [px]")
    for name, view in result["views"].items():
        errors_px = "".join(f"{view[key]:12.4f}" for key in ("mean_error_px", "holdout_error_px", "true_error_px"))
        lines.append(f"{name:8}{errors_px}  {view['verdict']}")
    lines += ["", f"quality factor against the true scene: {result['quality_factor']:.3f}"]
    lines.append(_droplets_line(result["droplets"]))
    lines.append(_liquid_line(result["liquid"]))
    lines.append("seconds: " + ", ".join(f"{step} {seconds:g}" for step, seconds in result["seconds"].items()))
    lines.append(f"report: {result['report']}")
    return "\n".join(lines)


def _droplets_line(droplets: dict[str, Any]) -> str:
    """What was measured of the droplets, or why nothing was."""
    if droplets["d32_um"] is None:
        return f"droplets: {droplets['verdict']}: {'; '.join(droplets['reasons'])}"
    d32 = "D32 {value:.1f} um ({low:.1f} to {high:.1f})".format(**droplets["d32_um"])
    return (
        f"{counted(droplets['droplets'], 'droplet')}, {droplets['verdict']}: "
        f"{100 * droplets['found_share']:.1f} % of those from "
        f"{droplets['counted_from_um']:g} um on found, {100 * droplets['true_ghost_share']:.1f} % ghosts, {d32}, "
        f"true {droplets['true_d32_um']:.1f} um; {counted(droplets['liquid_objects'], 'ligament')} masked, "
        f"{100 * droplets['hidden_share']:.1f} % of the volume hidden{_velocity(droplets)}"
    )


def _velocity(droplets: dict[str, Any]) -> str:
    if droplets["velocity_rms_m_s"] is None:
        return ""
    means_m_s = (droplets["velocity"]["mean_m_s"], droplets["true_velocity_m_s"])
    told, true = (", ".join(f"{one:.2f}" for one in mean) for mean in means_m_s)
    return (
        f"; velocities: {droplets['velocity']['pairs']}, mean ({told}) m/s, in truth ({true}) m/s for those that "
        "are of true droplets, "
        f"rms error {droplets['velocity_rms_m_s']:.2f} m/s"
    )


def _liquid(liquid: MeasuredLiquid) -> dict[str, Any]:
    return {
        "shots": len(liquid.found),
        **liquid.summary.model_dump(mode="json"),
        "true_break_up_mm": liquid.true_break_up_mm,
    }


def _liquid_line(liquid: dict[str, Any]) -> str:
    """The break-up length against the truth, or why there is none."""
    true = f"true {liquid['true_break_up_mm']:.2f} mm"
    length = liquid["break_up_mm"]
    if length is None:
        told = f"no break-up length: {liquid['break_up_reason']}, {true}"
    else:
        high = "beyond the field" if length["high"] is None else f"{length['high']:.2f}"
        told = f"break-up length {length['value']:.2f} mm ({length['low']:.2f} to {high}), {true}"
    objects = ", ".join(counted(liquid[f"{name}s"], name) for name in ("ligament", "sheet", "cluster"))
    return f"{told}; {objects} in exposure A of {counted(liquid['shots'], 'shot')}"
