"""What the demonstration made, as the page report.html and as the JSON object of the command."""

from pathlib import Path
from typing import Any

import numpy as np

from daq.files.run_directory import RunReader
from processing.figures.residual_figures import residuals_figure
from processing.figures.volume_figures import isosurface_figure, shadowgraph_figure, slices_figure
from processing.preprocessing import Intensity
from processing.reconstruction.volume_file import read_volume
from processing.runs.results_file import volume_path
from processing.volume import VoxelGrid
from server.demo.demo import Demonstration
from server.demo.report import Picture, Section, Table, write_report

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
        "seconds": demo.seconds,
        "report": str(report),
    }


def readable_summary(result: dict[str, Any]) -> str:
    """The same for a person."""
    lines = [f"{result['shots_valid']} of {result['shots_planned']} shots valid", ""]
    lines.append(f"{'view':8}{'mean error':>12}{'hold-out':>12}{'true error':>12}  [px]")
    for name, view in result["views"].items():
        errors_px = "".join(f"{view[key]:12.4f}" for key in ("mean_error_px", "holdout_error_px", "true_error_px"))
        lines.append(f"{name:8}{errors_px}  {view['verdict']}")
    lines += ["", f"quality factor against the true scene: {result['quality_factor']:.3f}"]
    lines.append("seconds: " + ", ".join(f"{step} {seconds:g}" for step, seconds in result["seconds"].items()))
    lines.append(f"report: {result['report']}")
    return "\n".join(lines)


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
        Section("Detail", pictures=[_detail({name: entry[0] for name, entry in volumes.items()}, grid)]),
    ]
    write_report(file, f"tomoshadow: {demo.sample_run.name}", sections)


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
