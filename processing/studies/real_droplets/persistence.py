"""How many ghosts droplets without a partner tell, in double exposures whose truth is known.

The cases are those of ``reality``; droplets fly with gradients and scatter from A to B, as in ``study velocity``.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from processing.analysis.droplets.droplet_file import joined
from processing.analysis.droplets.droplet_search import plan_droplets
from processing.analysis.droplets.ghost_share import RADIUS_VOXEL, GhostShare, matches
from processing.analysis.estimates import Estimate
from processing.analysis.two_exposures.watched_droplets import Watched, watched
from processing.analysis.velocity.measured_velocities import measure_velocities
from processing.analysis.velocity.unpaired_ghosts import unpaired_ghost_share
from processing.figures.reality_figure import ToldShare, ghosts_figure
from processing.geometry import FloatArray
from processing.kernels import DEFAULT_THREADS
from processing.studies.droplets import IMAGE_SIZE_PX, DropletCase
from processing.studies.real_droplets.case_shares import CaseShare, share_statements
from processing.studies.real_droplets.reality import RealityStudy
from processing.studies.report import Statement, grouped
from processing.studies.simulated_droplets import study_grid
from processing.studies.velocity.double_scenes import FLOW, SEPARATION_NS, double_scene
from processing.studies.velocity.measured_case import AnyCase, measured_case
from processing.synthetic.liquid.droplet_clouds import Flow


@dataclass(frozen=True, eq=False)
class WatchedShot:
    """A double exposure that was measured: droplets that should be in both, and which of them are real."""

    seen: Watched
    real: NDArray[np.bool_]
    residual_over_noise: float


@dataclass(frozen=True)
class PersistenceRow:
    """A case, all double exposures together: droplets that should be in both, and ghosts among them.

    ``told``, ``low`` and ``high`` are shares of ghosts by partners, not a number with a ``reason`` where that is not
    told; ``expected`` is the share that ``p_real`` makes expect.
    """

    kind: str
    case: str
    shots: int
    residual_over_noise: float
    droplets: int
    ghosts: int
    unpaired: int
    paired_ghosts: int
    told: float
    low: float
    high: float
    expected: float
    reason: str


def persistence_study(
    study: RealityStudy | None = None, threads: int = DEFAULT_THREADS, flow: Flow = FLOW
) -> Iterator[PersistenceRow]:
    """Simulate, measure and compare, case by case. The same study gives the same rows."""
    study = study or RealityStudy()
    for case in study.cases:
        yield _row(case, [watched_shot(case, seed, study.shape, threads, flow) for seed in study.seeds])


def watched_shot(
    case: AnyCase, seed: int, shape: tuple[int, int, int], threads: int = DEFAULT_THREADS, flow: Flow = FLOW
) -> WatchedShot:
    """Simulate a double exposure of a case, measure it, and say which droplets are real."""
    grid = study_grid(shape)
    scene = double_scene(case, grid, IMAGE_SIZE_PX, np.random.default_rng(seed), flow)
    search = plan_droplets(scene.cameras, grid)
    pair = first, second = [measured_case(case, images, search, threads, "gaussian") for images in scene.images]
    velocities = measure_velocities(first, second, grid, SEPARATION_NS).columns()
    tables = {frame: {**one.droplets.columns(), **velocities[frame]} for frame, one in zip("ab", pair, strict=True)}
    found = zip(pair, (scene.before, scene.after), strict=True)
    real = np.concatenate(
        [
            matches(one.droplets.points_mm, spray.positions_mm, RADIUS_VOXEL * grid.pitch_mm)[0] >= 0
            for one, spray in found
        ]
    )
    seen = watched(joined(tables), grid)
    return WatchedShot(seen, real[seen.rows], max(one.residual_over_noise or 0.0 for one in pair))


def _row(case: AnyCase, shots: Sequence[WatchedShot]) -> PersistenceRow:
    told = unpaired_ghost_share([shot.seen for shot in shots])
    real, paired = np.concatenate([shot.real for shot in shots]), np.concatenate([shot.seen.paired for shot in shots])
    value, low, high = (told.value, told.low, told.high) if isinstance(told, Estimate) else (float("nan"),) * 3
    return PersistenceRow(
        kind="bright" if isinstance(case, DropletCase) else "shadows",
        case=case.name,
        shots=len(shots),
        residual_over_noise=max(shot.residual_over_noise for shot in shots),
        droplets=len(real),
        ghosts=int(np.count_nonzero(~real)),
        unpaired=int(np.count_nonzero(~paired)),
        paired_ghosts=int(np.count_nonzero(paired & ~real)),
        told=value,
        low=low,
        high=high,
        expected=_expected(np.concatenate([shot.seen.p_real for shot in shots])),
        reason=told if isinstance(told, str) else "",
    )


def _expected(p_real: FloatArray) -> float:
    """Share of ghosts by p_real; not a number where all shots are doubtful, which tell none."""
    known = p_real[np.isfinite(p_real)]
    return float(np.mean(1 - known)) if len(known) else float("nan")


def persistence_shares(rows: Sequence[PersistenceRow]) -> list[CaseShare]:
    """Told and true shares of ghosts, case by case."""
    return [
        CaseShare(
            row.kind,
            row.case,
            row.residual_over_noise,
            Estimate(value=row.told, low=row.low, high=row.high),
            not row.reason,
            GhostShare(row.ghosts, row.droplets),
        )
        for row in rows
    ]


def persistence_line(row: PersistenceRow) -> str:
    """A case, for people."""
    shares = f"{100 * row.unpaired / row.droplets:.2f} % without a partner, {100 * row.told:.2f} % ghosts by that"
    true = f"{100 * row.ghosts / row.droplets:.2f} % true, {100 * row.expected:.2f} % by p_real"
    return f"{row.kind}, {row.case}: {shares}, {true}; {row.paired_ghosts} of {row.ghosts} ghosts have a partner"


def persistence_statements(rows: Sequence[PersistenceRow]) -> list[Statement]:
    """Of all cases together, then as of ``reality``."""
    return [_ghosts_again(rows), *share_statements(persistence_shares(rows))]


def _ghosts_again(rows: Sequence[PersistenceRow]) -> Statement:
    ghosts, again = (sum(getattr(row, name) for row in rows) for name in ("ghosts", "paired_ghosts"))
    droplets, unpaired = (sum(getattr(row, name) for row in rows) for name in ("droplets", "unpaired"))
    real, real_again = droplets - ghosts, droplets - unpaired - again
    text = f"{real_again} of {real} real droplets have a partner, {again} of {ghosts} ghosts"
    return Statement("persistence from A to B", "left open", text)


def persistence_figure(rows: Sequence[PersistenceRow]) -> Figure:
    """True shares of ghosts against those that are told by partners."""
    told = [one for one in persistence_shares(rows) if one.told]
    return ghosts_figure(
        {
            kind: [ToldShare(one.estimate, one.true_share) for one in chosen]
            for kind, chosen in grouped(told, lambda one: one.kind).items()
        }
    )
