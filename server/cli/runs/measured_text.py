"""What ``measure`` tells people: a line per shot, and a sentence for the run."""

from typing import Any

from daq.counted import counted
from server.cli.options import describe_grid
from server.cli.output import table
from server.reports.digits import digits_of_interval


def droplets_table(result: dict[str, Any]) -> str:
    """A line per shot, for people."""
    rows = [
        [
            str(shot["shot"]),
            str(shot["droplets"]),
            _number(shot["residual_over_noise"], 3),
            "" if shot["ghost_share"] is None else f"{100 * shot['ghost_share']:.2f}",
            f"{100 * shot['hidden_share']:.1f}" if shot["hidden_share"] else "",
            _paired(shot["velocity"]),
            f"{shot['cpu_s']:.1f}",
            shot["verdict"],
            shot["file"],
        ]
        for shot in result["shots"]
    ]
    head = ["shot", "droplets", "residual/noise", "ghosts %", "hidden %", "paired %", "CPU-s", "verdict", "file"]
    return table(head, rows)


def _paired(velocity: dict[str, Any] | None) -> str:
    return f"{100 * velocity['share_paired']:.1f}" if velocity and velocity["pairs"] else ""


def _number(value: float | None, digits: int) -> str:
    return "" if value is None else f"{value:.{digits}f}"


def droplets_summary(result: dict[str, Any]) -> str:
    """What was measured of a run, in a sentence."""
    statistics = result["statistics"]
    grid = describe_grid(result["grid"]["shape"], result["grid"]["pitch_mm"])
    if not statistics["exposures"]:
        return f"no shot could be measured, {grid}"
    seen = f"{counted(statistics['n'], 'droplet')} in {counted(statistics['exposures'], 'exposure')}"
    density = _with_interval(statistics["number_density_per_mm3"])
    d32_um, why = statistics["d32_um"], statistics["reason"]
    d32 = f"D32 {_with_interval(d32_um)} um" if d32_um else f"no D32: {why}"
    hidden = f", {100 * statistics['hidden_share']:.1f} % of the volume hidden" if statistics["hidden_share"] else ""
    told = f"{seen}, {density} per mm3, {d32}{hidden}, {_mean_velocity(result['velocity'])}, {grid}"
    return f"{told}{_ghosts(statistics)}{_liquid(result)}"


def _ghosts(statistics: dict[str, Any]) -> str:
    """How many of the droplets are ghosts, or why that is not known, in a line of its own."""
    share = statistics["ghost_share"]
    if share is None:
        return f"\nno share of ghosts: {statistics['ghost_reason']}"
    percent = {name: 100 * one for name, one in share.items()}
    return f"\nghosts among them {_with_interval(percent)} %"


def _liquid(result: dict[str, Any]) -> str:
    """What is no droplet, in a line of its own; nothing where nobody looked."""
    if result["polarity"] != "shadow":
        return ""
    objects = ", ".join(f"{result[name]} {name}{_sizes(result, name)}" for name in ("ligaments", "sheets", "clusters"))
    length = result["break_up_mm"]
    if length is None:
        return f"\n{objects}; no break-up length: {result['break_up_reason']}"
    most = "beyond the field" if length["high"] is None else f"{length['high']:.2f}"
    unknown = f"; {result['break_up_reason']}" if result["break_up_reason"] else ""
    told = f"break-up length {length['value']:.2f} mm ({length['low']:.2f} to {most})"
    return f"\n{objects}; {told}, shots: {result['break_up_shots']}{unknown}"


def _sizes(result: dict[str, Any], name: str) -> str:
    """Medians of ligaments, where they are told."""
    medians = result["ligament_medians"] if name == "ligaments" else None
    if medians is None:
        return ""
    length, width = (_with_interval(medians[size]) for size in ("length_mm", "width_mm"))
    return f" (medians: {length} mm long, {width} mm wide)"


def _mean_velocity(velocity: dict[str, Any]) -> str:
    if velocity["mean_m_s"] is None:
        return f"no velocity: {velocity['reason']}"
    components = (f"{name} {_with_interval(estimate)}" for name, estimate in velocity["mean_m_s"].items())
    return "; ".join([f"{counted(velocity['pairs'], 'pair')}, {', '.join(components)} m/s", *velocity["doubts"]])


def _with_interval(estimate: dict[str, float]) -> str:
    value, low, high = digits_of_interval(estimate["value"], estimate["low"], estimate["high"])
    return f"{value} ({low} to {high})"
