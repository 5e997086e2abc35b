"""What the demonstration made, as the page report.html and as the JSON object of the command."""

from pathlib import Path
from typing import Any

import numpy as np

from daq.files.run_directory import RunReader
from processing.analysis.spray.spray_statistics import AskedFor
from processing.figures.found_figures import found_figure
from processing.figures.residual_figures import residuals_figure
from processing.figures.size_figures import droplets_in_space_figure
from processing.figures.velocity_figures import velocities_figure
from processing.figures.volume_figures import isosurface_figure, shadowgraph_figure, slices_figure
from processing.preprocessing import Intensity
from processing.reconstruction.volume_file import read_volume
from processing.runs.results_file import volume_path
from processing.runs.sprays.measured_spray import read_files
from processing.volume import VoxelGrid
from server.demo.demo import Demonstration
from server.demo.demo_droplets import COUNTED_UM, MeasuredDroplets
from server.reports.page import Picture, Section, Table, write_report
from server.reports.spray_report import ReportedSpray, spray_sections

DETAIL_MM = 4.0
"""Edge of the cube that is shown as an iso-surface, as in Fig. 4 of the paper."""
ISO_QUANTILE = 0.99


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
        "seconds": demo.seconds,
        "report": str(report),
    }


def _measured(droplets: MeasuredDroplets) -> dict[str, Any]:
    d32_um = droplets.statistics.d32_um
    return {
        **droplets.shot.model_dump(mode="json", exclude={"file"}),
        "counted_from_um": COUNTED_UM,
        "found_share": droplets.found_share,
        "true_ghost_share": droplets.ghost_share,
        "reasons": _reasons(droplets),
        "d32_um": None if d32_um is None else d32_um.model_dump(mode="json"),
        "true_d32_um": droplets.true_d32_um,
        "velocity_rms_m_s": droplets.velocity_rms_m_s,
        "file": str(droplets.file),
    }


def _reasons(droplets: MeasuredDroplets) -> list[str]:
    """Why the shot is not good, or has no D32."""
    statistics = droplets.statistics
    return [*droplets.shot.reasons, *([statistics.reason] if statistics.reason and statistics.d32_um is None else [])]


def readable_summary(result: dict[str, Any]) -> str:
    """The same for a person."""
    lines = [f"{result['shots_valid']} of {result['shots_planned']} shots valid", ""]
    lines.append(f"{'view':8}{'mean error':>12}{'hold-out':>12}{'true error':>12}  [px]")
    for name, view in result["views"].items():
        errors_px = "".join(f"{view[key]:12.4f}" for key in ("mean_error_px", "holdout_error_px", "true_error_px"))
        lines.append(f"{name:8}{errors_px}  {view['verdict']}")
    lines += ["", f"quality factor against the true scene: {result['quality_factor']:.3f}"]
    lines.append(_droplets_line(result["droplets"]))
    lines.append("seconds: " + ", ".join(f"{step} {seconds:g}" for step, seconds in result["seconds"].items()))
    lines.append(f"report: {result['report']}")
    return "\n".join(lines)


def _droplets_line(droplets: dict[str, Any]) -> str:
    """What was measured of the droplets, or why nothing was."""
    if droplets["d32_um"] is None:
        return f"droplets: {droplets['verdict']}: {'; '.join(droplets['reasons'])}"
    d32 = "D32 {value:.1f} um ({low:.1f} to {high:.1f})".format(**droplets["d32_um"])
    return (
        f"{droplets['droplets']} droplets, {droplets['verdict']}: {100 * droplets['found_share']:.1f} % of those from "
        f"{droplets['counted_from_um']:g} um on found, {100 * droplets['true_ghost_share']:.1f} % ghosts, {d32}, "
        f"true {droplets['true_d32_um']:.1f} um; {droplets['liquid_objects']} ligaments masked, "
        f"{100 * droplets['hidden_share']:.1f} % of the volume hidden{_velocity(droplets)}"
    )


def _velocity(droplets: dict[str, Any]) -> str:
    if droplets["velocity_rms_m_s"] is None:
        return ""
    u, v, w = droplets["velocity"]["mean_m_s"]
    return (
        f"; {droplets['velocity']['pairs']} velocities, mean ({u:.2f}, {v:.2f}, {w:.2f}) m/s, "
        f"rms error {droplets['velocity_rms_m_s']:.2f} m/s"
    )


def write_demo_report(demo: Demonstration, file: Path) -> None:
    """Write report.html."""
    first = demo.results[0].shot
    volumes = {
        "A": read_volume(volume_path(demo.results_dir, first, "a")),
        "B": read_volume(volume_path(demo.results_dir, first, "b")),
    }
    volume, grid, _ = volumes["A"]
    title = f"shot {first}, exposure A, {demo.results[0].method.value.upper()}"
    sections = [
        Section("Summary", tables=[_steps(demo), _shots(demo)]),
        Section("Calibration", _CALIBRATION_TEXT, [_views(demo)], [_residuals(demo)]),
        Section("Shadowgraphs", pictures=[_shadowgraphs(demo.sample_run, first)]),
        Section("Volume", pictures=[Picture(slices_figure(volume, grid, title), "Slices and maximum projections")]),
        _droplets_section(demo.droplets),
        *_spray_sections(demo.droplets),
        Section("Detail", pictures=[_detail({name: entry[0] for name, entry in volumes.items()}, grid)]),
    ]
    write_report(file, f"tomoshadow: {demo.sample_run.name}", sections)


_DROPLETS_TEXT = (
    "A box downstream of the break-up, in both exposures of one shot. Nothing is given but the calibration; ligaments "
    "are masked. Droplets that are hidden by them count as missed. The truth is that of the simulated bench."
)


def _droplets_section(droplets: MeasuredDroplets) -> Section:
    """What was measured, where and how large, and beside it the truth; the reason where nothing could be."""
    text = " ".join([_DROPLETS_TEXT, *_reasons(droplets)])
    if droplets.statistics.d32_um is None:
        return Section("Droplets", text, [_droplets_table(droplets)])
    pictures = [
        Picture(droplets_in_space_figure(droplets.stored), "Measured droplets, larger ones larger"),
        Picture(
            found_figure(droplets.found, droplets.missed, droplets.ghosts),
            f"Against the truth, from {COUNTED_UM:g} µm on, both exposures",
        ),
    ]
    if droplets.velocity_rms_m_s is not None:
        pictures.append(Picture(velocities_figure(droplets.stored), "Velocities of droplets that both exposures show"))
    return Section("Droplets", text, [_droplets_table(droplets)], pictures)


def _spray_sections(droplets: MeasuredDroplets) -> list[Section]:
    """Sizes, patternation and number density of the box, as the report of any spray has them."""
    spray = read_files([droplets.file])
    return spray_sections(ReportedSpray.of(spray, AskedFor(spray.axis)))


def _droplets_table(droplets: MeasuredDroplets) -> Table:
    shot, d32 = droplets.shot, droplets.statistics.d32_um
    ratio = "" if shot.residual_over_noise is None else f"{shot.residual_over_noise:.2f}"
    rows = [
        ["droplets", f"{shot.droplets}"],
        ["verdict", shot.verdict.value],
        ["residual / noise", ratio],
        [f"found, of those from {COUNTED_UM:g} µm on", f"{100 * droplets.found_share:.1f} %"],
        ["ghosts among them", f"{100 * droplets.ghost_share:.1f} %"],
        ["D32", "" if d32 is None else f"{d32.value:.1f} µm ({d32.low:.1f} to {d32.high:.1f})"],
        ["true D32", f"{droplets.true_d32_um:.1f} µm"],
        ["velocities", _velocities(droplets)],
        ["masked ligaments", f"{shot.liquid_objects}"],
        ["volume that could not be measured", f"{100 * shot.hidden_share:.1f} %"],
    ]
    return Table(["", "box"], rows)


def _velocities(droplets: MeasuredDroplets) -> str:
    shot = droplets.shot
    if shot.velocity is None or droplets.velocity_rms_m_s is None:
        return shot.velocity_reason or "; ".join(shot.velocity.reasons if shot.velocity else ())
    shares = f"{shot.velocity.pairs} pairs, {100 * (shot.velocity.share_paired or 0):.1f} % of what both exposures show"
    return f"{shares}; error of a component {droplets.velocity_rms_m_s:.2f} m/s"


_CALIBRATION_TEXT = (
    "Mean error: eq. 2 over all corners. Hold-out error: planes that the fit has not seen. True error: the largest "
    "distance between the calibrated and the true camera anywhere in the volume, which only a simulated bench knows."
)


def _views(demo: Demonstration) -> Table:
    rows = [
        [
            name,
            f"{view.n_points}",
            f"{view.mean_error_px:.4f}",
            f"{view.holdout_error_px:.4f}",
            f"{demo.true_error_px[name]:.4f}",
            view.verdict.value,
        ]
        for name, view in demo.calibration.views.items()
    ]
    return Table(["view", "corners", "mean error [px]", "hold-out error [px]", "true error [px]", "verdict"], rows)


def _steps(demo: Demonstration) -> Table:
    return Table(["step", "seconds"], [[step, f"{seconds:.1f}"] for step, seconds in demo.seconds.items()])


def _shots(demo: Demonstration) -> Table:
    rows = [
        [
            f"{result.shot}",
            f"{volume.frame.upper()}",
            f"{volume.seconds:.2f}",
            f"{quality:.3f}" if volume.frame == "a" else "",
        ]
        for result, quality in zip(demo.results, demo.quality_factors, strict=True)
        for volume in result.volumes
    ]
    return Table(["shot", "exposure", "reconstruction [s]", "quality factor"], rows)


def _residuals(demo: Demonstration) -> Picture:
    return Picture(residuals_figure(demo.calibration), "Mean back-projection error per plane (Fig. 3 of the paper)")


def _shadowgraphs(run_dir: Path, shot: int) -> Picture:
    with RunReader(run_dir) as run:
        views = run.read_shot(shot).views
    return Picture(
        shadowgraph_figure({name: view.frame_a for name, view in views.items()}), f"Shot {shot}, exposure A, all views"
    )


def _detail(frames: dict[str, Intensity], grid: VoxelGrid) -> Picture:
    """Iso-surfaces of A and B in the cube with the most liquid."""
    edge = min(round(DETAIL_MM / grid.pitch_mm), *grid.shape)
    corner = _densest_corner(frames["A"], edge)
    cube = tuple(slice(start, start + edge) for start in corner)
    shown = {name: np.ascontiguousarray(volume[cube]) for name, volume in frames.items()}
    origin_mm = grid.to_mm(np.array(corner, dtype=np.float64))
    detail = VoxelGrid(
        (edge, edge, edge), (float(origin_mm[0]), float(origin_mm[1]), float(origin_mm[2])), grid.pitch_mm
    )
    level = float(np.quantile(shown["A"], ISO_QUANTILE))
    caption = "Iso-surfaces of exposures A and B in a cube of 4 mm (Fig. 4 of the paper)"
    return Picture(isosurface_figure(shown, detail, level), caption)


def _densest_corner(volume: Intensity, edge: int) -> tuple[int, int, int]:
    """Corner of the cube of one edge that holds the most intensity, on a lattice of half an edge."""
    half = max(edge // 2, 1)
    corners = [
        (z, y, x)
        for z in range(0, volume.shape[0] - edge + 1, half)
        for y in range(0, volume.shape[1] - edge + 1, half)
        for x in range(0, volume.shape[2] - edge + 1, half)
    ]
    return max(
        corners, key=lambda at: float(volume[at[0] : at[0] + edge, at[1] : at[1] + edge, at[2] : at[2] + edge].sum())
    )
