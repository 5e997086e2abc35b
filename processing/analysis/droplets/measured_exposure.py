"""What the measurement of an exposure comes to, bright particles or shadows: droplets, and whether to believe them."""

from dataclasses import asdict, dataclass, replace
from enum import StrEnum
from typing import TYPE_CHECKING, Generic, TypeVar

from processing.analysis.droplets.droplet_table import DropletRows
from processing.analysis.droplets.ghost_share import BESIDE_LIQUID, MANY_OBJECTS, UNTRIED, GhostShare, told_share
from processing.analysis.estimates import Estimate
from processing.analysis.hidden import Hidden

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Rows = TypeVar("Rows", bound=DropletRows, covariant=True)
Seen = TypeVar("Seen", bound="DataclassInstance", covariant=True)


class ShotVerdict(StrEnum):
    """What droplets of an exposure are good for."""

    GOOD = "good"
    EMPTY = "empty"
    DOUBTFUL = "doubtful"
    REFUSED = "refused"


NOTHING_HIDDEN = Hidden()


@dataclass(frozen=True, eq=False)
class MeasuredExposure(Generic[Rows, Seen]):
    """One exposure.

    Parameters
    ----------
    droplets : Droplets | SizedDroplets
        Those within the grid; none where the exposure is refused.
    views : dict of name to SeenView | SeenShadows
        What each view looks like; empty where nothing was fitted.
    residual_over_noise : float | None
        Root mean square of what the droplets do not explain, over the noise; None where nothing was fitted.
    verdict : ShotVerdict
        What it is good for.
    reasons : tuple of str
        Why it is no better, and what to do.
    twins : GhostShare | None
        Ghosts of its twins, a witness; None where none were asked for, or where they would not tell.
    hidden : Hidden
        What could not be measured.
    """

    droplets: Rows
    views: dict[str, Seen]
    residual_over_noise: float | None
    verdict: ShotVerdict
    reasons: tuple[str, ...] = ()
    twins: GhostShare | None = None
    hidden: Hidden = NOTHING_HIDDEN

    @property
    def ghost_share(self) -> Estimate | str:
        """Which share of the droplets are ghosts, or why that is not told."""
        if self.verdict in (ShotVerdict.DOUBTFUL, ShotVerdict.REFUSED):
            return "; ".join(self.reasons)
        return told_share(self.droplets.p_real, self.droplets.sized, untried=self.untried)

    @property
    def beside_liquid(self) -> bool:
        """Whether there is more liquid that is no droplet than what ghosts were tried beside."""
        return self.hidden.liquid_objects > MANY_OBJECTS * len(self.droplets)

    @property
    def untried(self) -> str:
        """Why it may not be told how probably droplets are real."""
        return BESIDE_LIQUID if self.beside_liquid else UNTRIED

    def told(self) -> dict[str, object]:
        """What files say of it, beside the droplets."""
        return {
            "verdict": self.verdict.value,
            "reasons": self.reasons,
            "residual_over_noise": self.residual_over_noise,
            "views": {name: asdict(view) for name, view in self.views.items()},
            "twins": asdict(self.twins) if self.twins else None,
            "hidden": asdict(self.hidden),
        }

    def doubted(self, reasons: tuple[str, ...], *, before: bool = False) -> "MeasuredExposure[Rows, Seen]":
        """The same with reasons why it is no good, if there are any; before all others, where they may explain these.

        An empty one may not be empty then.
        """
        if not reasons:
            return self
        verdict = ShotVerdict.REFUSED if self.verdict is ShotVerdict.REFUSED else ShotVerdict.DOUBTFUL
        told = (*reasons, *self.reasons) if before else (*self.reasons, *reasons)
        return told_real(replace(self, verdict=verdict, reasons=told))


def told_real(shot: MeasuredExposure[Rows, Seen]) -> MeasuredExposure[Rows, Seen]:
    """A shot that tells how probably droplets are real, or does not: only in good ones of droplets that was tried."""
    tried = shot.verdict is ShotVerdict.GOOD and not shot.beside_liquid
    return shot if tried else replace(shot, droplets=shot.droplets.unsure())
