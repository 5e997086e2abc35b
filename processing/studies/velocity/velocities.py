"""Droplets paired, pairs that are wrong, and errors of velocities in double exposures, against known truth.

The truth has no part in it: droplets fly with gradients and scatter, each exposure is drawn and measured by itself.
"""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from processing.analysis.droplets.droplet_search import MARGIN_VOXEL, plan_droplets
from processing.analysis.droplets.ghost_share import RADIUS_VOXEL, matches
from processing.analysis.velocity.measured_velocities import MeasuredVelocities, measure_velocities
from processing.analysis.velocity.velocity_table import M_S_PER_MM_NS
from processing.figures.velocity_figures import LinkedCase, linked_figure
from processing.geometry import FloatArray
from processing.kernels import DEFAULT_THREADS
from processing.studies.droplets import IMAGE_SIZE_PX, SLAB, robust_sd
from processing.studies.report import Statement, all_kept, by_case, case_statements
from processing.studies.simulated_droplets import study_grid
from processing.studies.velocity.double_scenes import SEPARATION_NS, DoubleScene, double_scene
from processing.studies.velocity.measured_case import measured_case, plain_case
from processing.volume import VoxelGrid

Z_SCORES = (0.9, 1.2)
"""Their standard deviation must lie between."""


@dataclass(frozen=True)
class VelocityCase:
    """What to simulate, and what is asked for.

    Parameters
    ----------
    droplets : {"bright", "opaque"}
        Bright particles on black, or droplets in shadows.
    density_per_mm3 : float
        Of the droplets.
    least_paired : float | None
        Share of the droplets that are in the grid in both exposures.
    least_right : float | None
        Share of the pairs.
    most_rms_voxel : float | None
        Root mean square error of a component of the displacement.
    """

    droplets: Literal["bright", "opaque"] = "bright"
    density_per_mm3: float = 28.0
    least_paired: float | None = None
    least_right: float | None = None
    most_rms_voxel: float | None = None

    @property
    def name(self) -> str:
        """For tables and figures."""
        return f"{self.droplets}, {self.density_per_mm3:g}/mm³"


ASKED_FOR = (
    VelocityCase("bright", 28, least_paired=0.99, least_right=0.995, most_rms_voxel=0.06),
    VelocityCase("bright", 56, least_paired=0.98, least_right=0.995, most_rms_voxel=0.06),
    VelocityCase("opaque", 7, least_paired=0.95, least_right=0.995, most_rms_voxel=0.06),
    VelocityCase("opaque", 14, least_paired=0.95, least_right=0.995, most_rms_voxel=0.06),
    VelocityCase("opaque", 28, least_paired=0.92, least_right=0.995, most_rms_voxel=0.06),
)


@dataclass(frozen=True)
class VelocityStudy:
    """Which cases, and how often.

    Parameters
    ----------
    cases : tuple of VelocityCase
        What to simulate.
    seeds : tuple of int
        One double exposure each.
    shape : tuple[int, int, int]
        Voxels (nz, ny, nx) at 60 voxel/mm.
    image_size_px : tuple[int, int]
        (width, height) of every view.
    margin_voxel : int
        So far around the slab droplets are looked for.
    """

    cases: tuple[VelocityCase, ...] = ASKED_FOR
    seeds: tuple[int, ...] = (301, 302, 303, 304, 305)
    shape: tuple[int, int, int] = SLAB
    image_size_px: tuple[int, int] = IMAGE_SIZE_PX
    margin_voxel: int = MARGIN_VOXEL


@dataclass(frozen=True)
class VelocityRow:
    """One double exposure.

    ``paired`` is the share of the droplets that are in the grid in both exposures, ``right`` that of the pairs whose
    droplets are the same true one. ``rms_u_voxel`` and so on are errors of the displacement of right pairs, ``z_sd``
    the robust standard deviation of their errors over what the covariance says, ``told_wrong`` the share of wrong
    pairs as their probabilities have it.
    """

    case: str
    seed: int
    droplets: int
    least_voxel: float
    most_voxel: float
    paired: float
    right: float
    told_wrong: float
    rms_u_voxel: float
    rms_v_voxel: float
    rms_w_voxel: float
    z_sd: float
    verdict: str
    pairing_cpu_ms_per_droplet: float

    @property
    def rms_voxel(self) -> float:
        """Of a component, whichever: root mean square of the three."""
        return float(np.sqrt((self.rms_u_voxel**2 + self.rms_v_voxel**2 + self.rms_w_voxel**2) / 3))


def velocity_study(study: VelocityStudy | None = None, threads: int = DEFAULT_THREADS) -> Iterator[VelocityRow]:
    """Simulate, measure and compare, double exposure by double exposure."""
    study = study or VelocityStudy()
    grid = study_grid(study.shape)
    for case in study.cases:
        for seed in study.seeds:
            plain = plain_case(case.droplets, case.density_per_mm3)
            scene = double_scene(plain, grid, study.image_size_px, np.random.default_rng(seed))
            search = plan_droplets(scene.cameras, grid, margin_voxel=study.margin_voxel)
            first, second = (measured_case(plain, images, search, threads) for images in scene.images)
            started_cpu_s = time.process_time()
            velocities = measure_velocities(first, second, grid, SEPARATION_NS)
            cpu_s = time.process_time() - started_cpu_s
            found = [exposure.droplets.points_mm for exposure in (first, second)]
            yield _row(case, seed, scene, grid, found, velocities, cpu_s)


def _row(
    case: VelocityCase,
    seed: int,
    scene: DoubleScene,
    grid: VoxelGrid,
    found_mm: Sequence[FloatArray],
    velocities: MeasuredVelocities,
    cpu_s: float,
) -> VelocityRow:
    labels = [
        matches(points_mm, spray.positions_mm, RADIUS_VOXEL * grid.pitch_mm)[0]
        for points_mm, spray in zip(found_mm, (scene.before, scene.after), strict=True)
    ]
    own = np.flatnonzero(velocities.first.paired)
    label = labels[0][own]
    right = (label >= 0) & (label == labels[1][velocities.first.partners.partner[own]])
    both = grid.holds(scene.before.positions_mm) & grid.holds(scene.after.positions_mm)
    ways_voxel = np.linalg.norm(scene.moved_mm[both], axis=1) / grid.pitch_mm
    return VelocityRow(
        case=case.name,
        seed=seed,
        droplets=int(np.count_nonzero(both)),
        least_voxel=float(ways_voxel.min()),
        most_voxel=float(ways_voxel.max()),
        paired=float(np.count_nonzero(both[label[right]]) / np.count_nonzero(both)),
        right=float(np.mean(right)) if len(own) else 0.0,
        told_wrong=velocities.wrong_share or 0.0,
        **_errors(velocities, own[right], scene.moved_mm[label[right]], grid.pitch_mm),
        verdict=velocities.verdict.value,
        pairing_cpu_ms_per_droplet=1000 * cpu_s / len(found_mm[0]),
    )


def _errors(
    velocities: MeasuredVelocities, rows: NDArray[np.intp], moved_mm: FloatArray, pitch_mm: float
) -> dict[str, float]:
    """Root mean square errors of displacements in voxels, and robust standard deviation of z-scores."""
    if not len(rows):
        return dict.fromkeys(("rms_u_voxel", "rms_v_voxel", "rms_w_voxel", "z_sd"), float("nan"))
    m_s_per_mm = M_S_PER_MM_NS / velocities.separation_ns
    errors_m_s = velocities.first.velocities_m_s[rows] - m_s_per_mm * moved_mm
    scores = errors_m_s / np.sqrt(np.einsum("nii->ni", velocities.first.covariance_m2_s2[rows]))
    u, v, w = (np.sqrt(np.mean(errors_m_s**2, axis=0)) / (m_s_per_mm * pitch_mm)).tolist()
    return {"rms_u_voxel": u, "rms_v_voxel": v, "rms_w_voxel": w, "z_sd": robust_sd(scores)}


def velocity_line(row: VelocityRow) -> str:
    """A double exposure, for people."""
    shares = f"{100 * row.paired:.2f} % paired, {100 * row.right:.2f} % of the pairs right"
    rms = f"rms {row.rms_u_voxel:.3f} {row.rms_v_voxel:.3f} {row.rms_w_voxel:.3f} voxel, z {row.z_sd:.2f}"
    return f"{row.case}, seed {row.seed}: {shares}, {rms}, {row.pairing_cpu_ms_per_droplet:.2f} ms each"


def all_reached(rows: Sequence[VelocityRow], cases: Sequence[VelocityCase]) -> bool | None:
    """Whether every case keeps what is asked for; None where nothing is."""
    return all_kept(cases, rows, _reached)


def _reached(case: VelocityCase, rows: Sequence[VelocityRow]) -> bool | None:
    if case.least_paired is None:
        return None
    paired, right, rms_voxel, z_sd = _means(rows)
    return (
        paired >= case.least_paired
        and (case.least_right is None or right >= case.least_right)
        and (case.most_rms_voxel is None or rms_voxel <= case.most_rms_voxel)
        and Z_SCORES[0] <= z_sd <= Z_SCORES[1]
    )


def _means(rows: Sequence[VelocityRow]) -> tuple[float, float, float, float]:
    """Paired, right, rms and z-scores; means of all double exposures."""
    names = ("paired", "right", "rms_voxel", "z_sd")
    paired, right, rms_voxel, z_sd = (float(np.mean([getattr(row, name) for row in rows])) for name in names)
    return paired, right, rms_voxel, z_sd


def velocity_statements(rows: Sequence[VelocityRow], cases: Sequence[VelocityCase]) -> list[Statement]:
    """Mean and worst double exposure of every case."""
    topic = ": paired/right in %, mean and worst; rms of a component"
    return case_statements(by_case(cases, rows), lambda _: topic, _asked, _told)


def _asked(case: VelocityCase) -> str:
    if case.least_paired is None or case.least_right is None or case.most_rms_voxel is None:
        return "left open"
    shares = f"{100 * case.least_paired:.0f}/{100 * case.least_right:.1f}"
    return f"left open, here asked for {shares}; {case.most_rms_voxel:g} voxel"


def _told(rows: Sequence[VelocityRow]) -> str:
    paired, right, rms_voxel, z_sd = _means(rows)
    worst = f"{100 * min(row.paired for row in rows):.2f}/{100 * min(row.right for row in rows):.2f}"
    shares = f"{100 * paired:.2f}/{100 * right:.2f}, worst {worst}"
    u, v, w = (float(np.mean([getattr(row, f"rms_{name}_voxel") for row in rows])) for name in "uvw")
    return f"{shares}; {rms_voxel:.3f} voxel ({u:.3f}, {v:.3f}, {w:.3f}); z-scores {z_sd:.2f}"


def velocity_figure(rows: Sequence[VelocityRow], cases: Sequence[VelocityCase]) -> Figure:
    """Paired droplets, wrong pairs and errors of every case."""
    return linked_figure(
        {
            case.name: LinkedCase(
                [row.paired for row in its],
                [row.right for row in its],
                [row.rms_voxel for row in its],
                case.least_paired,
                case.least_right,
                case.most_rms_voxel,
            )
            for case, its in by_case(cases, rows)
        },
        ("paired [% of the droplets in both]", "right [% of the pairs]", "rms error of a component [voxel]"),
        "double exposure",
    )
