"""How fast the droplets of a double exposure fly, how sure that is, and whether to believe it."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from processing.analysis.droplets.droplet_table import Columns, Droplets, SizedDroplets
from processing.analysis.droplets.measured_exposure import MeasuredExposure, Seen, ShotVerdict
from processing.analysis.two_exposures.alone_droplets import Alone, alone_among
from processing.analysis.two_exposures.fast_leavers import leavers_told, leaving_weights
from processing.analysis.two_exposures.watched_droplets import staying
from processing.analysis.velocity.moving_droplets import MovingDroplets
from processing.analysis.velocity.pairing import Pairing, pair
from processing.analysis.velocity.velocity_table import M_S_PER_MM_NS, Velocities
from processing.analysis.velocity.velocity_verdict import FASTEST_M_S, judged
from processing.volume import VoxelGrid

Rows = Droplets | SizedDroplets


@dataclass(frozen=True, eq=False)
class MeasuredVelocities:
    """Velocities of a double exposure.

    Parameters
    ----------
    first, second : Velocities
        Of the droplets of A, and of B; the two of a pair have the same.
    separation_ns : float
        Time from A to B.
    stayed : int
        Droplets of A that should be in the grid in B, too, by the motion of their neighbours; of those without a
        partner, whichever of the motions is theirs.
    alone : Alone
        Droplets of both that should have a partner, and have none.
    verdict : ShotVerdict
        What velocities are good for; where they are refused, no droplet has one.
    reasons : tuple of str
        Why it is no better, and what to do.
    """

    first: Velocities
    second: Velocities
    separation_ns: float
    stayed: int
    alone: Alone
    verdict: ShotVerdict
    reasons: tuple[str, ...]

    @property
    def pairs(self) -> int:
        """Droplets of A with a partner."""
        return int(np.count_nonzero(self.first.paired))

    @property
    def share_paired(self) -> float | None:
        """Of the droplets of A that should be in the grid in B, too; None where there is none."""
        return min(1.0, self.pairs / self.stayed) if self.stayed else None

    @property
    def wrong_share(self) -> float | None:
        """Of the pairs, as their own probabilities have it; None without pairs."""
        return float(np.mean(1 - self.first.partners.p_pair[self.first.paired])) if self.pairs else None

    @property
    def mean_m_s(self) -> tuple[float, float, float] | None:
        """Mean (u, v, w) of all pairs; None without."""
        if not self.pairs:
            return None
        u, v, w = self.first.velocities_m_s[self.first.paired].mean(axis=0).tolist()
        return u, v, w

    def columns(self) -> Mapping[str, Columns]:
        """Columns of both exposures, for a table in which A comes before B."""
        return {"a": self.first.columns(len(self.first)), "b": self.second.columns(0)}


def measure_velocities(
    first: MeasuredExposure[Rows, Seen], second: MeasuredExposure[Rows, Seen], grid: VoxelGrid, separation_ns: float
) -> MeasuredVelocities:
    """Find for every droplet of exposure A the one of B that it is, and its velocity.

    No motion need be known: displacements of most droplets may be as large as 25 voxels. Droplets to which that gives
    no partner may have a motion of their own, of up to 75 voxels. Errors of the calibration are the same in both
    exposures, and cancel; so the covariance is that of the two places by noise.

    Parameters
    ----------
    first, second : MeasuredExposure
        A and B, as ``measure`` gives them.
    grid : VoxelGrid
        In which they were measured.
    separation_ns : float
        Time from A to B in nanoseconds, from the middle of one light pulse to that of the other.

    Returns
    -------
    MeasuredVelocities
        ``first`` and ``second`` with ``velocities_m_s``, ``covariance_m2_s2`` and ``partners``, a row per droplet;
        ``verdict``, ``reasons``, ``pairs``, ``share_paired`` and ``mean_m_s``.

    Raises
    ------
    ValueError
        The separation is not above 0, or droplets lie outside of the grid.
    """
    if not 0 < separation_ns < np.inf:
        raise ValueError(f"separation {separation_ns} ns: must be above 0")
    before, after = MovingDroplets.of(first.droplets, grid), MovingDroplets.of(second.droplets, grid)
    if not (_within(before, grid).all() and _within(after, grid).all()):
        raise ValueError("droplets lie outside of the grid: is it the one that they were measured in?")
    pairing = pair(before, after)
    stayed = _stayed(before, pairing, grid)
    alone = _alone(first.droplets, second.droplets, pairing, grid)
    verdict, reasons = judged((first, second), (before, after), pairing, stayed, alone)
    if verdict is ShotVerdict.REFUSED:
        pairing = pairing.disbelieved()
    of_first, of_second = _velocities(first.droplets, second.droplets, pairing, separation_ns)
    told = MeasuredVelocities(of_first, of_second, separation_ns, stayed, alone, verdict, reasons)
    doubts = tuple(_of_mean(told, grid))
    return replace(told, verdict=ShotVerdict.DOUBTFUL, reasons=(*reasons, *doubts)) if doubts else told


def _of_mean(told: MeasuredVelocities, grid: VoxelGrid) -> Iterator[str]:
    """What is wrong with the mean, whatever the pairs are."""
    if (speed_m_s := float(np.linalg.norm(told.mean_m_s or 0.0))) > FASTEST_M_S:
        at = f"droplets fly at {speed_m_s:.3g} m/s, faster than any spray"
        yield f"{at}: is the separation of {told.separation_ns:g} ns right?"
    velocities_m_s = told.first.velocities_m_s[told.first.paired]
    weights = leaving_weights(velocities_m_s, told.separation_ns, grid)
    yield from leavers_told(velocities_m_s, weights, len(told.first))


def _within(droplets: MovingDroplets, grid: VoxelGrid) -> NDArray[np.bool_]:
    """Which droplets lie in a grid, or next to it."""
    inside = (droplets.places > -1.5) & (droplets.places < np.array(grid.shape[::-1]) + 0.5)
    return np.asarray(inside.all(axis=1), np.bool_)


def _stayed(before: MovingDroplets, pairing: Pairing, grid: VoxelGrid) -> int:
    if not len(pairing.motions):
        return 0
    there = before.places + pairing.motions
    inside = np.all((there >= -0.5) & (there < np.array(grid.shape[::-1]) - 0.5), axis=(0, 2))
    return int(np.count_nonzero(inside | (pairing.first.partner >= 0)))


def _alone(before: Rows, after: Rows, pairing: Pairing, grid: VoxelGrid) -> Alone:
    """Droplets of both exposures that stay in the grid, and have no partner."""
    points_mm = np.concatenate([before.points_mm, after.points_mm])
    of_first, of_second = pairing.first.partner, pairing.second.partner
    partner = np.concatenate([np.where(of_first >= 0, of_first + len(before), -1), of_second])
    stays = staying(points_mm, np.arange(len(points_mm)) < len(before), partner, grid)
    return alone_among(np.concatenate([before.p_real, after.p_real])[stays], partner[stays] >= 0)


def _velocities(before: Rows, after: Rows, pairing: Pairing, separation_ns: float) -> tuple[Velocities, Velocities]:
    own, other = pairing.pairs
    m_s_per_mm = M_S_PER_MM_NS / separation_ns
    velocities_m_s = m_s_per_mm * (after.points_mm[other] - before.points_mm[own])
    covariance_m2_s2 = m_s_per_mm**2 * (before.covariance_mm2[own] + after.covariance_mm2[other])
    return (
        Velocities.of_pairs(pairing.first, own, velocities_m_s, covariance_m2_s2),
        Velocities.of_pairs(pairing.second, other, velocities_m_s, covariance_m2_s2),
    )
