"""Tracks that are whole, links that are right, and errors of the motion in series of shots, against known truth.

All from images: every shot is drawn and measured by itself, and what was found is linked. The truth has no part in it.
"""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from matplotlib.figure import Figure

from processing.analysis.droplets.droplet_search import MARGIN_VOXEL, plan_droplets
from processing.analysis.droplets.droplet_table import Droplets, SizedDroplets
from processing.analysis.droplets.ghost_share import RADIUS_VOXEL, matches
from processing.analysis.velocity.moving_droplets import MovingDroplets
from processing.analysis.velocity.track_motion import TrackPoints, track_points
from processing.analysis.velocity.tracks import link
from processing.figures.velocity_figures import LinkedCase, linked_figure
from processing.geometry import FloatArray
from processing.kernels import DEFAULT_THREADS
from processing.studies.droplets import robust_sd
from processing.studies.report import Statement, all_kept, by_case, case_statements
from processing.studies.simulated_droplets import study_cameras, study_grid
from processing.studies.velocity.double_scenes import case_images
from processing.studies.velocity.measured_case import measured_case, plain_case
from processing.studies.velocity.series_scenes import RATE_HZ, FlyingDroplets, flying_droplets
from processing.studies.velocity.track_truth import Labels, whole_and_right
from processing.volume import VoxelGrid

SHAPE, IMAGE_SIZE_PX = (250, 100, 250), (400, 160)
"""Of the volume: the full depth of the paper's; and of the images, wide enough for all of it."""
MOTION = ("rms_velocity_voxel", "rms_acceleration_voxel", "z_velocity", "z_acceleration")


@dataclass(frozen=True)
class TrackCase:
    """What to simulate, and what is asked for.

    Parameters
    ----------
    droplets : {"bright", "opaque"}
        Bright particles on black, or droplets in shadows.
    density_per_mm3 : float
        Of the droplets.
    least_whole : float | None
        Share of the true droplets found at least three times that are one track, from their first shot to their last.
    least_right : float | None
        Share of the links.
    """

    droplets: Literal["bright", "opaque"] = "bright"
    density_per_mm3: float = 28.0
    least_whole: float | None = None
    least_right: float | None = None

    @property
    def name(self) -> str:
        """For tables and figures."""
        return f"{self.droplets}, {self.density_per_mm3:g}/mm³"


ASKED_FOR = (
    TrackCase("bright", 28, least_whole=0.95, least_right=0.99),
    TrackCase("opaque", 28, least_whole=0.95, least_right=0.99),
)


@dataclass(frozen=True)
class TrackStudy:
    """Which cases, and how often.

    Parameters
    ----------
    cases : tuple of TrackCase
        What to simulate.
    seeds : tuple of int
        One series each.
    shots : int
        Of a series.
    shape : tuple[int, int, int]
        Voxels (nz, ny, nx) at 60 voxel/mm.
    image_size_px : tuple[int, int]
        (width, height) of every view.
    margin_voxel : int
        So far around the slab droplets are looked for.
    """

    cases: tuple[TrackCase, ...] = ASKED_FOR
    seeds: tuple[int, ...] = (501, 502, 503, 504, 505)
    shots: int = 20
    shape: tuple[int, int, int] = SHAPE
    image_size_px: tuple[int, int] = IMAGE_SIZE_PX
    margin_voxel: int = MARGIN_VOXEL


@dataclass(frozen=True)
class TrackRow:
    """One series.

    ``droplets`` were found in a shot, on average; ``whole`` is the share of the true droplets found at least three
    times that are one track, ``right`` that of the links between droplets that are the same true one. ``rms_*`` are
    errors of a component of velocity (voxel per shot) and acceleration (voxel per shot squared), ``z_*`` robust
    standard deviations of these errors over what the tracks say.
    """

    case: str
    seed: int
    shots: int
    droplets: float
    tracks: int
    whole: float
    right: float
    rms_velocity_voxel: float
    rms_acceleration_voxel: float
    z_velocity: float
    z_acceleration: float
    linking_cpu_ms_per_droplet: float


def track_study(study: TrackStudy | None = None, threads: int = DEFAULT_THREADS) -> Iterator[TrackRow]:
    """Simulate, measure, link and compare, series by series."""
    study = study or TrackStudy()
    for case in study.cases:
        for seed in study.seeds:
            yield _row(study, case, seed, threads)


def _row(study: TrackStudy, case: TrackCase, seed: int, threads: int) -> TrackRow:
    grid, rng = study_grid(study.shape), np.random.default_rng(seed)
    flying = flying_droplets(case.density_per_mm3, grid, study.shots, rng)
    found = list(_found(study, case, flying, grid, rng, threads))
    frames = [MovingDroplets.of(droplets, grid) for droplets in found]
    labels = [_labels(droplets, flying.positions_mm(shot), grid) for shot, droplets in enumerate(found)]
    started_cpu_s = time.process_time()
    tracks = link(frames)
    cpu_s = time.process_time() - started_cpu_s
    whole, right = whole_and_right(tracks.ids, labels)
    return TrackRow(
        case=case.name,
        seed=seed,
        shots=study.shots,
        droplets=float(np.mean([len(frame) for frame in frames])),
        tracks=tracks.count,
        whole=whole,
        right=right,
        **_errors(track_points(frames, tracks), labels, flying, grid.pitch_mm),
        linking_cpu_ms_per_droplet=1000 * cpu_s / max(sum(map(len, frames)), 1),
    )


def _found(
    study: TrackStudy,
    case: TrackCase,
    flying: FlyingDroplets,
    grid: VoxelGrid,
    rng: np.random.Generator,
    threads: int,
) -> Iterator[Droplets | SizedDroplets]:
    """What is found in the images of every shot."""
    cameras, plain = study_cameras(study.image_size_px), plain_case(case.droplets, case.density_per_mm3)
    search = plan_droplets(cameras, grid, margin_voxel=study.margin_voxel)
    for shot in range(study.shots):
        shown = flying.shown(shot, grid)
        images = case_images(plain, cameras, flying.spray(shot, shown), flying.heights[shown], rng)
        yield measured_case(plain, images, search, threads).droplets


def _labels(droplets: Droplets | SizedDroplets, true_mm: FloatArray, grid: VoxelGrid) -> Labels:
    return matches(droplets.points_mm, true_mm, RADIUS_VOXEL * grid.pitch_mm)[0].astype(np.intp)


def _errors(points: TrackPoints, labels: Sequence[Labels], flying: FlyingDroplets, pitch_mm: float) -> dict[str, float]:
    label = np.array([labels[frame][row] for frame, row in zip(points.frame, points.row, strict=True)], np.intp)
    known = (label >= 0) & np.isfinite(points.velocities[:, 0])
    if not known.any():
        return dict.fromkeys(MOTION, float("nan"))
    frame, who = points.frame[known], label[known]
    true_mm_per_s = np.array([flying.velocities_mm_per_s(shot) for shot in range(len(labels))])[frame, who]
    velocity = points.velocities[known] - true_mm_per_s / (RATE_HZ * pitch_mm)
    acceleration = points.accelerations[known] - flying.accelerations_mm_per_s2[who] / (RATE_HZ**2 * pitch_mm)
    velocity_sd = np.sqrt(np.einsum("nii->ni", points.velocity_covariance[known]))
    scores = (velocity / velocity_sd, acceleration / points.acceleration_sd[known])
    rms = (float(np.sqrt(np.mean(errors**2))) for errors in (velocity, acceleration))
    return dict(zip(MOTION, (*rms, *map(robust_sd, scores)), strict=True))


def track_line(row: TrackRow) -> str:
    """A series, for people."""
    shares = f"{row.tracks} tracks, {100 * row.whole:.2f} % whole, {100 * row.right:.2f} % of the links right"
    motion = f"rms {row.rms_velocity_voxel:.3f} voxel/shot, {row.rms_acceleration_voxel:.3f} voxel/shot²"
    scores = f"z {row.z_velocity:.2f} {row.z_acceleration:.2f}"
    return f"{row.case}, seed {row.seed}: {shares}, {motion}, {scores}, {row.linking_cpu_ms_per_droplet:.2f} ms each"


def all_reached(rows: Sequence[TrackRow], cases: Sequence[TrackCase]) -> bool | None:
    """Whether every case keeps what is asked for; None where nothing is."""
    return all_kept(cases, rows, _reached)


def _reached(case: TrackCase, rows: Sequence[TrackRow]) -> bool | None:
    if case.least_whole is None:
        return None
    return _mean(rows, "whole") >= case.least_whole and (
        case.least_right is None or _mean(rows, "right") >= case.least_right
    )


def _mean(rows: Sequence[TrackRow], name: str) -> float:
    return float(np.mean([getattr(row, name) for row in rows]))


def track_statements(rows: Sequence[TrackRow], cases: Sequence[TrackCase]) -> list[Statement]:
    """Mean and worst series of every case."""
    topic = "shots: whole tracks/right links in %, mean and worst; rms of a component"
    return case_statements(by_case(cases, rows), lambda its: f", {its[0].shots} {topic}", _asked, _told)


def _asked(case: TrackCase) -> str:
    if case.least_whole is None or case.least_right is None:
        return "left open"
    return f"left open, here asked for {100 * case.least_whole:.0f}/{100 * case.least_right:.0f}"


def _told(rows: Sequence[TrackRow]) -> str:
    worst = f"{100 * min(row.whole for row in rows):.2f}/{100 * min(row.right for row in rows):.2f}"
    shares = f"{100 * _mean(rows, 'whole'):.2f}/{100 * _mean(rows, 'right'):.2f}, worst {worst}"
    velocity, acceleration = (_mean(rows, f"rms_{name}_voxel") for name in ("velocity", "acceleration"))
    scores = f"z-scores {_mean(rows, 'z_velocity'):.2f}, {_mean(rows, 'z_acceleration'):.2f}"
    return f"{shares}; {velocity:.3f} voxel/shot, {acceleration:.3f} voxel/shot²; {scores}"


def track_figure(rows: Sequence[TrackRow], cases: Sequence[TrackCase]) -> Figure:
    """Whole tracks, right links and errors of every case."""
    return linked_figure(
        {
            case.name: LinkedCase(
                [row.whole for row in its],
                [row.right for row in its],
                [row.rms_velocity_voxel for row in its],
                case.least_whole,
                case.least_right,
            )
            for case, its in by_case(cases, rows)
        },
        ("whole tracks [% of the droplets]", "right [% of the links]", "rms error of a component [voxel/shot]"),
        "series",
    )
