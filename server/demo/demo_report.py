"""What the demonstration made, as the page report.html: first what a spray is asked for, against the truth."""

from pathlib import Path

import numpy as np

from daq.counted import counted
from daq.files.run_directory import RunReader
from processing.figures.found_figures import found_figure
from processing.figures.residual_figures import residuals_figure
from processing.figures.velocity_figures import velocities_figure
from processing.figures.volume_figures import isosurface_figure, shadowgraph_figure, slices_figure
from processing.preprocessing import Intensity
from processing.reconstruction.volume_file import read_volume
from processing.runs.results_file import volume_path
from processing.volume import VoxelGrid
from server.demo.demo import Demonstration
from server.demo.demo_answers import answers_table
from server.demo.demo_droplets import COUNTED_UM, MeasuredDroplets
from server.demo.demo_liquid import MeasuredLiquid
from server.demo.demo_summary import reasons_of
from server.reports.liquid_sections import ReportedLiquid, break_up_section, unknown_section
from server.reports.object_motion_section import object_motion_section
from server.reports.page import Picture, Section, Table, write_report
from server.reports.shots_section import shots_section
from server.reports.spray_report import (
    ReportedSpray,
    conditions_of,
    definitions_section,
    origin_section,
    spray_sections,
)
from server.reports.spray_tables import doubts

DETAIL_MM = 4.0
"""Edge of the cube that is shown as an iso-surface, as in Fig. 4 of the paper."""
ISO_QUANTILE = 0.99


def write_demo_report(demo: Demonstration, file: Path) -> None:
    """Write report.html: one page of answers, then the chain from images to figures of the spray."""
    reported = demo.spray
    shots = reported.spray.shots
    sections = [
        Section(
            "Summary",
            _SUMMARY_TEXT,
            [answers_table(demo.droplets, demo.liquid, reported)],
            (),
            _doubts(demo, reported),
        ),
        origin_section(reported),
        *_of_images(demo),
        _break_up(demo.liquid),
        *_said(object_motion_section(shots)),
        _droplets_section(demo.droplets),
        *spray_sections(reported),
        *_said(unknown_section(shots)),
        shots_section(shots),
        Section("Calibration", _CALIBRATION_TEXT, [_views(demo)], [_residuals(demo)]),
        Section("Quality and times", _QUALITY_TEXT, [_shots(demo), _steps(demo)]),
        definitions_section(),
    ]
    write_report(file, f"A simulated hollow-cone spray, measured: {demo.sample_run.name}", sections)


_SUMMARY_TEXT = (
    "The spray is simulated, so that its truth is known; cameras, light and everything after them do not know it. "
    "Intervals hold 95 %; those of droplets and velocities are of one shot, and do not know how shots differ. The "
    "truth of sizes, density, flux and cone angles is of all droplets in the box, that of mean velocities of the "
    f"droplets that have one; ghosts and droplets that were found are counted from {COUNTED_UM:g} µm on."
)


def _doubts(demo: Demonstration, reported: ReportedSpray) -> list[str]:
    """What was measured, how it was judged, and why something is not told."""
    shot, told = demo.droplets.shot, reported.told
    measured = (
        f"Droplets: both exposures of shot {shot.shot}, {shot.verdict.value}. Break-up: exposure A of "
        f"{counted(len(demo.liquid.found), 'shot')}."
    )
    liquid = demo.liquid.summary
    unknown = [] if liquid.break_up_mm else [f"No break-up length: {liquid.break_up_reason}"]
    return [measured, *conditions_of(reported), *reasons_of(demo.droplets), *unknown, *doubts(told)]


def _said(section: Section | None) -> list[Section]:
    return [section] if section else []


def _of_images(demo: Demonstration) -> list[Section]:
    """Images of the first shot, and its volumes."""
    first, method = demo.results[0].shot, demo.results[0].method.value.upper()
    volumes = {
        "A": read_volume(volume_path(demo.results_dir, first, "a")),
        "B": read_volume(volume_path(demo.results_dir, first, "b")),
    }
    volume, grid, _ = volumes["A"]
    slices = slices_figure(volume, grid, f"shot {first}, exposure A, {method}")
    return [
        Section("Shadowgraphs", pictures=[_shadowgraphs(demo.sample_run, first)]),
        Section("Volume", pictures=[Picture(slices, _SLICES)]),
        Section("Detail", pictures=[_detail({name: entry[0] for name, entry in volumes.items()}, grid, first)]),
    ]


_SLICES = (
    "Slices through the planes that hold most (top), and maxima along each direction (bottom). 1 is black in all "
    "views; colours follow the square root, so that single droplets show beside the sheet."
)


_VELOCITIES = (
    "Droplets of exposure A in three projections, with arrows and colours of their velocities; dots have none: their "
    "partner was not found, or left the box."
)
_DROPLETS_TEXT = (
    "A box downstream of the break-up, in both exposures of one shot. Nothing is given but the calibration; ligaments "
    "are masked. Droplets that are hidden by them count as missed. The truth is that of the simulated bench."
)


def _droplets_section(droplets: MeasuredDroplets) -> Section:
    """What was measured, where and how large, and beside it the truth; the reason where nothing could be."""
    table, points = _droplets_table(droplets), reasons_of(droplets)
    if droplets.statistics.d32_um is None:
        return Section("Droplets", _DROPLETS_TEXT, [table], points=points)
    pictures = [
        Picture(
            found_figure(droplets.found, droplets.missed, droplets.ghosts),
            f"Droplets against the truth, from {COUNTED_UM:g} µm on, of both exposures: each true one is there twice, "
            "as far apart as it flew. Left: seen along the axis, large droplets as large dots. Right: by size.",
        )
    ]
    if droplets.velocities:
        figure = velocities_figure(droplets.stored, title=f"shot {droplets.shot.shot}")
        pictures.append(Picture(figure, _VELOCITIES))
    return Section("Droplets", _DROPLETS_TEXT, [table], pictures, points)


def _break_up(liquid: MeasuredLiquid) -> Section:
    """Of exposure A of all shots, against the truth."""
    objects = liquid.objects
    return break_up_section(ReportedLiquid(liquid.reaches, len(objects), objects, objects[0], liquid.true_mm))


def _droplets_table(droplets: MeasuredDroplets) -> Table:
    shot = droplets.shot
    ratio = "" if shot.residual_over_noise is None else f"{shot.residual_over_noise:.2f}"
    rows = [
        ["droplets", f"{shot.droplets}"],
        ["verdict", shot.verdict.value],
        ["residual / noise", ratio],
        ["velocities", _velocities(droplets)],
        ["ligaments and the like that are masked, both exposures", f"{shot.liquid_objects}"],
        ["volume that could not be measured, worse exposure", f"{100 * shot.hidden_share:.1f} %"],
    ]
    return Table(["", ""], rows, words=True)


def _velocities(droplets: MeasuredDroplets) -> str:
    shot = droplets.shot
    if shot.velocity is None or droplets.velocities is None:
        return shot.velocity_reason or "; ".join(shot.velocity.reasons if shot.velocity else ())
    share = 100 * (shot.velocity.share_paired or 0)
    return (
        f"{counted(shot.velocity.pairs, 'pair')}, {share:.1f} % of the droplets of A that do not leave the box until B"
    )


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


_QUALITY_TEXT = "Quality factor: correlation of the volume of exposure A with the true spray (c_II); 1 is equal."


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
    return Picture(
        residuals_figure(demo.calibration),
        "Mean back-projection error of every plane of the target; dashed: what the paper of the method stayed below.",
    )


def _shadowgraphs(run_dir: Path, shot: int) -> Picture:
    with RunReader(run_dir) as run:
        views = run.read_shot(shot).views
    return Picture(
        shadowgraph_figure({name: view.frame_a for name, view in views.items()}),
        f"Shot {shot}, exposure A, all views: grey values as recorded, black is 0.",
    )


def _detail(frames: dict[str, Intensity], grid: VoxelGrid, shot: int) -> Picture:
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
    caption = (
        f"Shot {shot}: surfaces where the intensity is {level:.2f}, in exposures A and B, in the cube of "
        f"{DETAIL_MM:g} mm that holds most; {100 * (1 - ISO_QUANTILE):.0f} % of exposure A are above."
    )
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
