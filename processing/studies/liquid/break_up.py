"""Break-up lengths of the paper's nozzles from images with noise, run by run, against balls that touch; and classes."""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from matplotlib.figure import Figure

from processing.analysis.objects.break_up import NEAR_MM, THRESHOLDS, Nozzle, Reach
from processing.analysis.objects.connected_share import break_up_of, connected_share
from processing.analysis.objects.liquid_objects import ObjectClass
from processing.analysis.objects.object_search import ExposureObjects, measure_objects, plan_objects
from processing.figures.object_figures import BreakUpCurve, ObjectsShot, objects_figure
from processing.geometry import FloatArray
from processing.kernels import DEFAULT_THREADS
from processing.studies.liquid.isolated_objects import KINDS, LOST, IsolatedObject
from processing.studies.report import Statement, grouped
from processing.synthetic.liquid.connected_balls import connected_length_mm
from processing.synthetic.liquid.nozzles import FLAT_FAN_FLOW, HOLLOW_CONE_FLOW, flat_fan_spray, hollow_cone_spray
from processing.synthetic.paper_rig import IMAGE_SCALE_PX_PER_MM, paper_cameras, paper_optics
from processing.synthetic.rendering import render_transmittance
from processing.synthetic.scene import SprayFactory
from processing.synthetic.shadow_shots import Counting
from processing.volume import VoxelGrid

NOZZLES: dict[str, tuple[SprayFactory, tuple[float, float, float]]] = {
    "hollow cone": (hollow_cone_spray, HOLLOW_CONE_FLOW.orifice_mm),
    "flat fan": (flat_fan_spray, FLAT_FAN_FLOW.orifice_mm),
}
MOST_ERROR_MM, LEAST_RUNS = 0.5, 0.9
LEAST_RIGHT = dict(zip((kind.value for kind in KINDS), (0.99, 0.95, 0.85), strict=True))
"""Asked for."""
VOLUME_MM = (18.0, 17.25, 9.0)
"""Of the paper, x, y, z."""


@dataclass(frozen=True)
class BreakUpStudy:
    """Which runs.

    Parameters
    ----------
    runs : int
        Of each nozzle, each of its own seed.
    shots : int
        Of each run.
    binning : int
        Of pixels.
    seed : int
        Of the first run.
    noise : float
        Of the background.
    """

    runs: int = 5
    shots: int = 4
    binning: int = 1
    seed: int = 901
    noise: float = 0.012


@dataclass(frozen=True)
class BreakUpRow:
    """A run: what is told, what is true, in mm from the nozzle, and at which threshold of darkness it would be what."""

    nozzle: str
    seed: int
    shots: int
    value_mm: float
    low_mm: float
    high_mm: float
    true_mm: float
    held: bool
    at_20_mm: float
    at_30_mm: float
    at_40_mm: float
    at_50_mm: float
    worst_shot_mm: float
    ligaments: int
    sheets: int
    clusters: int
    cpu_s_per_exposure: float


@dataclass(frozen=True, eq=False)
class StudiedRun:
    """A run, and all that figures need of it."""

    row: BreakUpRow
    reaches: list[Reach]
    true_mm: FloatArray
    last: ExposureObjects = field(repr=False)
    places: VoxelGrid


def break_up_study(study: BreakUpStudy | None = None, threads: int = DEFAULT_THREADS) -> Iterator[StudiedRun]:
    """Simulate, measure and compare, run by run. The same study gives the same lengths; times differ."""
    study = study or BreakUpStudy()
    for nozzle in NOZZLES:
        for run in range(study.runs):
            yield _run(study, nozzle, study.seed + run, threads)


def _run(study: BreakUpStudy, name: str, seed: int, threads: int) -> StudiedRun:
    make, orifice_mm = NOZZLES[name]
    cameras, optics = list(paper_cameras(study.binning).values()), list(paper_optics(study.binning).values())
    search = plan_objects(cameras, paper_volume(study.binning), Nozzle(orifice_mm))
    counting, rng = Counting.of_noise(study.noise), np.random.default_rng(seed)
    found, true_mm, cpu_s = [], [], 0.0
    for shot in range(study.shots):
        spray = make([seed, shot])
        true_mm.append(connected_length_mm(spray, np.array(orifice_mm), NEAR_MM))
        images = [
            counting.transmission(render_transmittance(camera, spray, view), rng)
            for camera, view in zip(cameras, optics, strict=True)
        ]
        started_s = time.process_time()
        found.append(measure_objects(images, search, threads=threads))
        cpu_s += time.process_time() - started_s
    row = _row(name, seed, found, np.array(true_mm), cpu_s / study.shots)
    return StudiedRun(row, [one.reach for one in found], np.array(true_mm), found[-1], search.places)


def paper_volume(binning: int) -> VoxelGrid:
    """The paper's volume, one voxel per pixel."""
    pitch_mm = binning / IMAGE_SCALE_PX_PER_MM
    nx, ny, nz = (round(size_mm / pitch_mm) for size_mm in VOLUME_MM)
    return VoxelGrid.centred((nz, ny, nx), pitch_mm)


def _row(name: str, seed: int, found: Sequence[ExposureObjects], true_mm: FloatArray, cpu_s: float) -> BreakUpRow:
    told, nan = break_up_of([one.reach for one in found]), float("nan")
    value_mm, low_mm = told.value_mm or nan, told.low_mm or nan
    high_mm = told.high_mm or (float("inf") if told.value_mm else nan)
    reach_mm = np.array([one.reach.reach_mm or (nan,) * len(THRESHOLDS) for one in found])
    at_20_mm, at_30_mm, at_40_mm, at_50_mm = np.median(reach_mm, axis=0).tolist()
    true = float(np.median(true_mm))
    return BreakUpRow(
        nozzle=name,
        seed=seed,
        shots=len(found),
        value_mm=value_mm,
        low_mm=low_mm,
        high_mm=high_mm,
        true_mm=true,
        held=low_mm <= true <= high_mm,
        at_20_mm=at_20_mm,
        at_30_mm=at_30_mm,
        at_40_mm=at_40_mm,
        at_50_mm=at_50_mm,
        worst_shot_mm=float(np.abs(reach_mm[:, 1] - true_mm).max()),
        ligaments=sum(one.objects.count(ObjectClass.LIGAMENT) for one in found),
        sheets=sum(one.objects.count(ObjectClass.SHEET) for one in found),
        clusters=sum(one.objects.count(ObjectClass.CLUSTER) for one in found),
        cpu_s_per_exposure=cpu_s,
    )


def break_up_line(run: StudiedRun) -> str:
    """A run, for people."""
    row = run.row
    told = f"{row.value_mm:.2f} mm ({row.low_mm:.2f} to {row.high_mm:.2f}), true {row.true_mm:.2f} mm"
    return f"{row.nozzle}, seed {row.seed}: {told}; {row.cpu_s_per_exposure:.1f} CPU-s per exposure"


def right_shares(objects: Sequence[IsolatedObject]) -> dict[str, float]:
    """Share of each kind that is told for what it is, of those that are dark enough to be told at all."""
    told = [one for one in objects if one.told != LOST]
    return {
        kind: float(np.mean([one.told == kind for one in chosen]))
        for kind, chosen in grouped(told, lambda one: one.kind).items()
    }


def break_up_reached(rows: Sequence[BreakUpRow], objects: Sequence[IsolatedObject]) -> bool:
    """Whether lengths, intervals and classes keep what is asked for."""
    close = all(abs(row.value_mm - row.true_mm) <= MOST_ERROR_MM for row in rows)
    held = np.mean([row.held for row in rows]) >= LEAST_RUNS
    right = all(share >= LEAST_RIGHT[kind] for kind, share in right_shares(objects).items())
    return bool(close and held and right)


def break_up_statements(rows: Sequence[BreakUpRow], objects: Sequence[IsolatedObject]) -> list[Statement]:
    """Lengths of each nozzle, and classes."""
    lengths = [_length_statement(name, chosen) for name, chosen in grouped(rows, lambda row: row.nozzle).items()]
    counts = {kind: len(chosen) for kind, chosen in grouped(objects, lambda one: one.kind).items()}
    shares = sorted(right_shares(objects).items())
    classes = ", ".join(f"{kind}s {100 * share:.0f} of {counts[kind]}" for kind, share in shares)
    classes += f"; too faint to be told: {sum(one.told == LOST for one in objects)}"
    asked = ", ".join(f"{kind}s {100 * LEAST_RIGHT[kind]:.0f}" for kind, _ in shares)
    return [
        *lengths,
        Statement("isolated objects told for what they are, %", f"left open, here asked for {asked}", classes),
    ]


def _length_statement(name: str, rows: Sequence[BreakUpRow]) -> Statement:
    errors_mm = np.array([row.value_mm - row.true_mm for row in rows])
    held = sum(row.held for row in rows)
    medians = [[getattr(row, f"at_{at}_mm") - row.true_mm for row in rows] for at in (20, 30, 40, 50)]
    spans = ", ".join(f"{min(one):+.2f} to {max(one):+.2f}" for one in medians)
    return Statement(
        f"{name}: break-up length, error of runs of {rows[0].shots} shots, largest and mean",
        f"left open, here asked for {MOST_ERROR_MM} mm, and limits around the truth in {LEAST_RUNS:.0%} of the runs",
        f"{errors_mm[np.abs(errors_mm).argmax()]:+.2f}, {errors_mm.mean():+.2f} mm, held in {held} of {len(rows)}; "
        f"by thresholds 0.2, 0.3, 0.4, 0.5: {spans} mm; worst single shot {max(r.worst_shot_mm for r in rows):.2f} mm; "
        f"{np.mean([row.cpu_s_per_exposure for row in rows]):.1f} CPU-s per exposure",
    )


def break_up_figure(runs: Sequence[StudiedRun]) -> Figure:
    """Curve of all shots of each nozzle with the truth, objects of one shot, and what views see there."""
    distances_mm = np.linspace(0, 12, 481)
    groups = grouped(runs, lambda run: run.row.nozzle)
    curves = {
        name: BreakUpCurve(
            connected_share([reach for run in chosen for reach in run.reaches], distances_mm),
            np.concatenate([run.true_mm for run in chosen]),
        )
        for name, chosen in groups.items()
    }
    shot = next(iter(groups.values()))[-1]
    return objects_figure(curves, ObjectsShot(shot.last.objects, shot.last.unseen, shot.places))
