"""Droplets that should have a partner in the other exposure and have none: perhaps they fly in a motion of their own.

A mean over those that have one is not that of all then. Ghosts have no partner, and now and then a real droplet is
missed; so droplets are asked that are surely real, and a few may be alone. Where nothing tells how real droplets are,
all are asked, and as many more may be alone as there are ghosts at most in a shot that is good.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import bdtrc

from processing.analysis.droplets.droplet_file import StoredDroplets
from processing.analysis.droplets.droplet_statistics import P_REAL, measured_grid
from processing.analysis.two_exposures.watched_droplets import PARTNER, SURE, watched
from processing.geometry import FloatArray

MOST_ALONE, MOST_ALONE_OR_GHOSTS = 0.05, 0.2
"""Share of the surely real droplets that may be alone, and of those of which nobody knows how real they are."""
CHANCE = 0.01
"""How often chance makes as many alone."""
REMEDY = "shorten the separation, so that all move by less than their neighbours are away, or measure each stream alone"


@dataclass(frozen=True)
class Alone:
    """How many droplets are alone.

    Parameters
    ----------
    asked : int
        Droplets that should be in the grid in both exposures, and are surely real where that is known.
    alone : int
        Of these, those without a partner.
    sure : bool
        Whether it is known that they are real.
    """

    asked: int
    alone: int
    sure: bool

    @property
    def share(self) -> float | None:
        """Of those that were asked; None where nobody was."""
        return self.alone / self.asked if self.asked else None

    @property
    def told(self) -> tuple[str, ...]:
        """What is wrong with mean velocities; nothing where chance, misses and ghosts explain it."""
        return self.said("should be in both exposures have no partner", "are not seen in both")

    def said(self, alone: str, unseen: str, most_sure: float = MOST_ALONE) -> tuple[str, ...]:
        """The same where droplets are alone in another way.

        Parameters
        ----------
        alone : str
            What they should do, and do not.
        unseen : str
            What else they may do than fly in another motion.
        most_sure : float
            Share of the surely real ones that may do so.
        """
        most = most_sure if self.sure else MOST_ALONE_OR_GHOSTS
        if not self.alone or bdtrc(self.alone - 1, self.asked, most) > CHANCE:
            return ()
        who = "surely real droplets" if self.sure else "droplets"
        return (
            f"{100 * self.alone / self.asked:.0f} % of the {who} that {alone}, limit {100 * most:.0f} %: they fly in "
            f"another motion than the others, or {unseen}; mean velocities and flux are not those of all. "
            f"{REMEDY[0].upper()}{REMEDY[1:]}",
        )


def alone_in_shots(shots: Sequence[StoredDroplets]) -> Alone:
    """How many droplets of all shots with velocities are alone, as their files have them."""
    seen = [
        watched(shot.columns, grid)
        for shot in shots
        if {PARTNER, P_REAL} <= shot.columns.keys() and (grid := measured_grid(shot))
    ]
    p_real = np.concatenate([np.empty(0), *(one.p_real for one in seen)])
    return alone_among(p_real, np.concatenate([np.empty(0, np.bool_), *(one.paired for one in seen)]))


def alone_among(p_real: FloatArray, paired: NDArray[np.bool_]) -> Alone:
    """How many droplets are alone.

    Parameters
    ----------
    p_real : (N,) array
        Of droplets that should be in the grid in both exposures: probability of being real, or not a number.
    paired : (N,) bool array
        Whether they have a partner.
    """
    sure = bool(np.count_nonzero(np.isfinite(p_real)) > len(p_real) / 2)
    asked = paired[p_real > SURE] if sure else paired
    return Alone(len(asked), int(np.count_nonzero(~asked)), sure)
