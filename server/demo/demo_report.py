"""What the demonstration made, as the page report.html: first what a spray is asked for, against the truth."""

from pathlib import Path

import numpy as np

from daq.files.run_directory import RunReader
from processing.analysis.droplets.ghost_share import share_interval
from processing.analysis.spray.spray_statistics import AskedFor
from processing.analysis.velocity.velocity_statistics import velocity_statistics
from processing.figures.found_figures import Placed, found_figure
from processing.figures.residual_figures import residuals_figure
from processing.figures.velocity_figures import velocities_figure
from processing.figures.volume_figures import isosurface_figure, shadowgraph_figure, slices_figure
from processing.preprocessing import Intensity
from processing.reconstruction.volume_file import read_volume
from processing.runs.liquid.objects import LiquidSummary
from processing.runs.results_file import volume_path
from processing.runs.sprays.measured_spray import read_files
from processing.volume import VoxelGrid
from server.demo.demo import Demonstration
from server.demo.demo_droplets import COUNTED_UM, MeasuredDroplets
from server.demo.demo_summary import reasons_of
from server.reports.liquid_sections import ReportedLiquid, break_up_section, unknown_section
from server.reports.object_motion_section import object_motion_section
from server.reports.page import Picture, Section, Table, write_report
from server.reports.spray_report import ReportedSpray, spray_sections

DETAIL_MM = 4.0
"""Edge of the cube that is shown as an iso-surface, as in Fig. 4 of the paper."""
ISO_QUANTILE = 0.99
EXPOSURES = 2
"""Of the shot whose droplets are measured."""


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
        Section("Summary", _SUMMARY_TEXT, [_against_truth(demo)]),
        Section("Shadowgraphs", pictures=[_shadowgraphs(demo.sample_run, first)]),
        Section("Volume", pictures=[Picture(slices_figure(volume, grid, title), "Slices and maximum projections")]),
        Section("Detail", pictures=[_detail({name: entry[0] for name, entry in volumes.items()}, grid)]),
        _droplets_section(demo.droplets),
        *_spray_sections(demo),
        Section("Calibration", _CALIBRATION_TEXT, [_views(demo)], [_residuals(demo)]),
        Section("Quality and times", _QUALITY_TEXT, [_shots(demo), _steps(demo)]),
    ]
    write_report(file, f"A simulated hollow-cone spray, measured: {demo.sample_run.name}", sections)


_SUMMARY_TEXT = (
    "The spray is simulated, so that its truth is known; cameras, light and everything after them do not know it. "
    "Intervals hold 95 %; those of droplets and velocities are of one shot, and do not know how shots differ. What was "
    "found and what are ghosts is counted by the truth, which a laboratory does not have."
)


def _against_truth(demo: Demonstration) -> Table:
    """The answers, beside the truth."""
    droplets, liquid = demo.droplets, demo.liquid.summary
    d32, velocities = droplets.statistics.d32_um, droplets.velocities
    rows = [
        ["D32 [µm]", *(_interval(d32.value, d32.low, d32.high, 1) if d32 else ["", ""]), f"{droplets.true_d32_um:.1f}"],
        ["break-up length [mm]", *_length(liquid), f"{demo.liquid.true_break_up_mm:.2f}"],
        [f"droplets from {COUNTED_UM:g} µm on, found [%]", *_share(droplets.found, droplets.missed), ""],
        ["ghosts among them [%]", *_share(droplets.ghosts, droplets.found), ""],
    ]
    means_m_s = velocity_statistics([droplets.stored]).mean_m_s
    if velocities and means_m_s:
        told = zip("uvw", (means_m_s.u, means_m_s.v, means_m_s.w), velocities.true_mean_m_s, strict=True)
        rows += [
            [f"mean velocity {name} [m/s]", *_interval(one.value, one.low, one.high, 2), f"{true:.2f}"]
            for name, one, true in told
        ]
        rows.append(["error of a velocity component, rms [m/s]", f"{velocities.rms_m_s:.2f}", "", ""])
    return Table(["", "measured", "95 % interval", "truth"], rows)


def _share(chosen: Placed, others: Placed) -> list[str]:
    """In percent, with its interval by counting; both exposures show the same droplets, and make nothing surer."""
    count, of = len(chosen), len(chosen) + len(others)
    low, high = share_interval(round(count / EXPOSURES), max(round(of / EXPOSURES), 1))
    return _interval(100 * count / max(of, 1), 100 * low, 100 * high, 1)


def _length(liquid: LiquidSummary) -> list[str]:
    found = liquid.break_up_mm
    return _interval(found.value, found.low, found.high, 2) if found else ["none", liquid.break_up_reason or ""]


def _interval(value: float, low: float, high: float | None, digits: int) -> list[str]:
    upper = "beyond the field" if high is None else f"{high:.{digits}f}"
    return [f"{value:.{digits}f}", f"{low:.{digits}f} to {upper}"]


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
            f"Droplets against the truth, from {COUNTED_UM:g} µm on, both exposures",
        )
    ]
    if droplets.velocities:
        figure = velocities_figure(droplets.stored, title=f"shot {droplets.shot.shot}")
        pictures.append(
            Picture(figure, "Velocities of droplets that both exposures show, seen along z, x and y; dots have none")
        )
    return Section("Droplets", _DROPLETS_TEXT, [table], pictures, points)


def _spray_sections(demo: Demonstration) -> list[Section]:
    """Sizes, velocities and density of the box, as the report of any spray has them; break-up of all shots."""
    spray = read_files([demo.droplets.file])
    liquid = demo.liquid
    first = liquid.found[0]
    told = ReportedLiquid(
        liquid.reaches, len(liquid.found), liquid.objects, first.objects, liquid.true_mm, liquid.places
    )
    unknown = unknown_section(spray.shots)
    return [
        *spray_sections(ReportedSpray.of(spray, AskedFor(spray.axis))),
        break_up_section(told),
        *(one for one in (object_motion_section(spray.shots), unknown) if one),
    ]


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
    return f"{shot.velocity.pairs} pairs, {share:.1f} % of the droplets of A that do not leave the box until B"


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
    return Picture(residuals_figure(demo.calibration), "Mean back-projection error per plane")


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
    caption = "Iso-surfaces of exposures A and B in a cube of 4 mm"
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
