"""Whether the share of ghosts is as it is told: pooled over the shots of a case, where the truth is known."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import rankdata

from processing.analysis.droplets.ghost_share import GhostShare
from processing.analysis.estimates import Estimate
from processing.studies.report import Statement, grouped

MOST_OFF, MOST_POINTS = 0.5, 0.005
"""So far a share may be from the true one, relative or absolute, whichever is more."""
WITH_GHOSTS, LEAST_CASES = (0.02, 0.15), 6
"""True shares of the cases by which it is judged, and how many there must be."""
LEAST_RANK = 0.8
"""Rank correlation of told and true shares among these."""
SIZED = "shadows"
"""The kind of which shares are told however many; of bright particles only few."""


@dataclass(frozen=True)
class CaseShare:
    """Ghosts of a case, all shots together.

    Parameters
    ----------
    kind, case : str
        ``bright`` or ``shadows``, and what was simulated.
    residual_over_noise : float
        Largest of the shots.
    estimate : Estimate
        Share that is expected.
    told : bool
        Whether it is told.
    true : GhostShare
        Ghosts that there are.
    """

    kind: str
    case: str
    residual_over_noise: float
    estimate: Estimate
    told: bool
    true: GhostShare

    @property
    def true_share(self) -> float:
        """Share that is so."""
        return self.true.share or 0.0

    @property
    def close(self) -> bool:
        """Whether the two are as close as is asked for."""
        return abs(self.estimate.value - self.true_share) <= max(MOST_OFF * self.true_share, MOST_POINTS)

    @property
    def held(self) -> bool:
        """Whether the interval holds the true share."""
        return self.estimate.low <= self.true_share <= self.estimate.high

    @property
    def judged(self) -> bool:
        """Whether it is one of the cases by which shares are judged."""
        return self.told and WITH_GHOSTS[0] <= self.true_share <= WITH_GHOSTS[1]


def all_close(shares: Iterable[CaseShare]) -> bool:
    """Whether every share that is told is close; of shadows also in enough cases with ghosts, and in order."""
    told = [share for share in shares if share.told]
    judged = [share for share in told if share.judged and share.kind == SIZED]
    return all(share.close for share in told) and len(judged) >= LEAST_CASES and _rank(judged) >= LEAST_RANK


def _rank(shares: Sequence[CaseShare]) -> float:
    """Spearman's correlation."""
    if len(shares) < 2:
        return float("nan")
    told, true = (
        rankdata(values) for values in zip(*((one.estimate.value, one.true_share) for one in shares), strict=True)
    )
    return float(np.corrcoef(told, true)[0, 1])


def share_statements(shares: Sequence[CaseShare]) -> list[Statement]:
    """Of each kind, then of each case."""
    asked = f"left open, here asked for {100 * MOST_OFF:.0f} % or {100 * MOST_POINTS:g} points"
    of_shadows = f"{asked}, {LEAST_CASES} cases of 2 to 15 %, rank correlation {LEAST_RANK:g}"
    kinds = [
        Statement(f"{kind}: share of ghosts told", of_shadows if kind == SIZED else asked, _kind_text(chosen))
        for kind, chosen in grouped(shares, lambda share: share.kind).items()
    ]
    return [*kinds, *(Statement(f"{one.kind}, {one.case}: share of ghosts told", asked, _text(one)) for one in shares)]


def _kind_text(shares: Sequence[CaseShare]) -> str:
    told, judged = [one for one in shares if one.told], [one for one in shares if one.judged]
    close = f"told of {len(told)} of {len(shares)} cases, close in {sum(one.close for one in told)}"
    held = f"within its interval in {sum(one.held for one in told)}"
    if not judged:
        return f"{close}, {held}"
    ranked = f"rank correlation {_rank(judged):.2f}"
    return f"{close}, {held}; of 2 to 15 % close in {sum(one.close for one in judged)} of {len(judged)}, {ranked}"


def _text(share: CaseShare) -> str:
    value, low, high, true = (
        f"{100 * one:.2f}" for one in (share.estimate.value, share.estimate.low, share.estimate.high, share.true_share)
    )
    told = f"{value} % ({low} to {high})" if share.told else f"not told ({value} % expected)"
    close = "" if share.close or not share.told else ", too far"
    return f"{told}, true {true} % of {share.true.found}{close}; residual / noise to {share.residual_over_noise:.2f}"
