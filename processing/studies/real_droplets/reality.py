"""Whether droplets are as probably real as is told: stated against true shares, where the truth is known.

Densities, widths, blurs and noises are others than those to which probabilities were fitted.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from matplotlib.figure import Figure

from processing.analysis.droplets.ghost_share import MOST_BRIGHT, GhostShare, expected_share
from processing.figures.reality_figure import StatedShares, ToldShare, reality_figure
from processing.kernels import DEFAULT_THREADS
from processing.studies.droplets import DropletCase
from processing.studies.real_droplets.case_shares import SIZED, CaseShare, share_statements
from processing.studies.real_droplets.judged_shots import SLAB, JudgedShot, judged_shot
from processing.studies.report import Statement, grouped
from processing.studies.shadows.sizes import SizeCase

BINS = (0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 0.99, 1.0)
UNSURE = (0.5, 0.9)
"""Of what is told within these, the true share must be within, too."""
MOST_OFF = 0.5
"""Share by which the expected number of ghosts may be wrong, over all shots of a kind."""
TRIED: tuple[DropletCase | SizeCase, ...] = (
    DropletCase(22, noise_percent=22),
    DropletCase(42, 1.2, 8),
    DropletCase(65, noise_percent=12),
    DropletCase(30, 1.8, 5),
    DropletCase(50, 1.6, 8),
    SizeCase(22),
    SizeCase(32, noise_percent=2.4),
    SizeCase(34, noise_percent=5, aperture_ratio=0.7),
    SizeCase(45, median_um=30, noise_percent=2),
    SizeCase(25, noise_percent=8),
    SizeCase(24, noise_percent=2, aperture_ratio=0.55),
    SizeCase(32, 36, noise_percent=5, aperture_ratio=0.6),
    SizeCase(28, noise_percent=5, aperture_ratio=0.55),
    SizeCase(40, noise_percent=8),
    SizeCase(40, 36, noise_percent=3, aperture_ratio=0.7),
    SizeCase(62, 25, noise_percent=5),
    SizeCase(36, 45, noise_percent=4),
    SizeCase(30, 35, spread=0.6, noise_percent=5),
    SizeCase(26, noise_percent=8, aperture_ratio=0.6),
    SizeCase(38, noise_percent=7),
)


@dataclass(frozen=True)
class RealityStudy:
    """Which cases, and how often.

    Parameters
    ----------
    cases : tuple of DropletCase | SizeCase
        What to simulate.
    seeds : tuple of int
        One shot each.
    shape : tuple[int, int, int]
        Voxels (nz, ny, nx) at 60 voxel/mm.
    """

    cases: tuple[DropletCase | SizeCase, ...] = TRIED
    seeds: tuple[int, ...] = (301, 302, 303)
    shape: tuple[int, int, int] = SLAB


@dataclass(frozen=True)
class RealityRow:
    """Droplets of a shot that are told as probably real by so much: how many, the mean of that, how many are real."""

    kind: str
    case: str
    seed: int
    residual_over_noise: float
    verdict: str
    least: float
    most: float
    droplets: int
    stated: float
    real: int


def reality_study(study: RealityStudy | None = None, threads: int = DEFAULT_THREADS) -> Iterator[RealityRow]:
    """Simulate, measure and compare, shot by shot. The same study gives the same rows."""
    study = study or RealityStudy()
    for case in study.cases:
        for seed in study.seeds:
            yield from _rows(case, seed, judged_shot(case, seed, study.shape, threads))


def _rows(case: DropletCase | SizeCase, seed: int, shot: JudgedShot) -> Iterator[RealityRow]:
    number = np.digitize(shot.p_real, BINS[1:-1])
    for bin_number, (least, most) in enumerate(pairwise(BINS)):
        chosen = (number == bin_number) & np.isfinite(shot.p_real)
        if chosen.any():
            yield RealityRow(
                kind=shot.kind,
                case=case.name,
                seed=seed,
                residual_over_noise=shot.residual_over_noise,
                verdict=shot.verdict,
                least=least,
                most=most,
                droplets=int(chosen.sum()),
                stated=float(shot.p_real[chosen].mean()),
                real=int(shot.real[chosen].sum()),
            )


def reality_line(row: RealityRow) -> str:
    """Droplets of a shot, for people."""
    real = f"{row.real} of {row.droplets} are real"
    return f"{row.kind}, {row.case}, seed {row.seed}, told as {row.least:g} to {row.most:g}: {real}"


def all_true(rows: Sequence[RealityRow]) -> bool:
    """Whether what is told is true: of the unsure as many are real as is stated, and so many are ghosts in all."""
    return all(_true(chosen) for chosen in grouped(rows, _kind).values())


def _true(rows: Sequence[RealityRow]) -> bool:
    expected, ghosts = _ghosts(rows)
    unsure = _unsure(rows)
    share = 1 - unsure.share if unsure.share is not None else UNSURE[0]
    return UNSURE[0] <= share <= UNSURE[1] and abs(expected - ghosts) <= MOST_OFF * ghosts


def _kind(row: RealityRow) -> str:
    return row.kind


def _ghosts(rows: Sequence[RealityRow]) -> tuple[float, int]:
    """How many are to be expected, and how many there are."""
    expected = sum(row.droplets * (1 - row.stated) for row in rows)
    return expected, sum(row.droplets - row.real for row in rows)


def _unsure(rows: Sequence[RealityRow]) -> GhostShare:
    chosen = [row for row in rows if row.least >= UNSURE[0] and row.most <= UNSURE[1]]
    return GhostShare(sum(row.droplets - row.real for row in chosen), sum(row.droplets for row in chosen))


def reality_statements(rows: Sequence[RealityRow]) -> list[Statement]:
    """True and stated shares of each kind, and shares of ghosts of each case."""
    kinds = grouped(rows, _kind).items()
    topic = f"real of those told as {UNSURE[0]:g} to {UNSURE[1]:g}"
    return [
        *(Statement(f"{kind}: {topic}", "left open", _unsure_text(chosen)) for kind, chosen in kinds),
        *(Statement(f"{kind}: ghosts", "left open", _ghosts_text(chosen)) for kind, chosen in kinds),
        *share_statements(case_shares(rows)),
    ]


def case_shares(rows: Sequence[RealityRow]) -> list[CaseShare]:
    """Told and true shares of ghosts, case by case."""
    return [_share(chosen) for chosen in grouped(rows, lambda row: (row.kind, row.case)).values()]


def _share(rows: Sequence[RealityRow]) -> CaseShare:
    expected, ghosts = _ghosts(rows)
    ratio, droplets = max(row.residual_over_noise for row in rows), sum(row.droplets for row in rows)
    estimate, kind = expected_share(expected, droplets), rows[0].kind
    told = kind == SIZED or estimate.value <= MOST_BRIGHT
    return CaseShare(kind, rows[0].case, ratio, estimate, told, GhostShare(ghosts, droplets))


def _unsure_text(rows: Sequence[RealityRow]) -> str:
    unsure = _unsure(rows)
    if unsure.interval is None:
        return "none is told so"
    low, high = (100 * (1 - end) for end in reversed(unsure.interval))
    real = f"{100 * (1 - unsure.ghosts / unsure.found):.0f} % of {unsure.found} ({low:.0f} to {high:.0f} %)"
    chosen = [row for row in rows if row.least >= UNSURE[0] and row.most <= UNSURE[1]]
    stated = sum(row.stated * row.droplets for row in chosen) / unsure.found
    return f"{real}, {100 * stated:.0f} % stated"


def _ghosts_text(rows: Sequence[RealityRow]) -> str:
    expected, ghosts = _ghosts(rows)
    return f"{ghosts} of {sum(row.droplets for row in rows)}, {expected:.1f} expected"


def reality_of_rows(rows: Sequence[RealityRow]) -> Figure:
    """True against stated shares of each kind, and true shares of ghosts against those that are told."""
    shares = {
        kind: [
            StatedShares(
                sum(row.stated * row.droplets for row in same) / sum(row.droplets for row in same),
                GhostShare(sum(row.droplets - row.real for row in same), sum(row.droplets for row in same)),
            )
            for same in grouped(chosen, _least).values()
        ]
        for kind, chosen in grouped(rows, _kind).items()
    }
    ghosts = grouped(case_shares(rows), lambda share: share.kind)
    told = {
        kind: [ToldShare(one.estimate, one.true_share) for one in chosen if one.told] for kind, chosen in ghosts.items()
    }
    return reality_figure(shares, told)


def _least(row: RealityRow) -> str:
    return f"{row.least:g}"
