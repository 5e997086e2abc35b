"""Are shadows longer along one direction than across it, in the mean of many? Droplets, and blur, are taken as round.

What moves while the light is on, an astigmatic lens, and droplets that are flattened look so; in few pixels none of
them shows in a droplet by itself. Of each shadow that stands alone in a view the light that it takes is asked how far
it reaches along the rows, and along the columns. Discs that overlap in space are one droplet, which was taken for two.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from processing.analysis.droplets.gaussian_blobs import Image
from processing.analysis.droplets.measured_exposure import MeasuredExposure, Rows, Seen
from processing.geometry import FloatArray

FEWEST, MOST = 3, 300
"""Shadows of a view that are asked."""
LEAST_SHADOWS, SURE = 20, 4.0
"""In all views, and standard deviations, from which on anything is told."""
LEAST_RATIO = 1.03
"""Of the axes of ovals: less is not told."""
MOST_LONGER, MOST_RATIO = 0.2, 1.12
"""Of the variance of the blur, and of the axes, above which together sizes are wrong. In simulated shots D32 is 0 to
3 % off up to there; beyond, droplets are taken for two (12 % more), or the light for another one (D32 -20 %). Shadows
that are large beside their smear, or beside their blur, are round enough."""
WRONG = " Number and diameters are wrong then"
Labels = NDArray[np.intp]


@dataclass(frozen=True)
class Elongation:
    """How much longer than wide the shadows of a view are, in the mean of the light that they take.

    Parameters
    ----------
    along_px2, mixed_px2 : float
        Mean square along the rows less that along the columns, and twice the mean product of both.
    sd_px2 : float
        Standard deviation of either.
    square_px2, blur_px2 : float
        Mean square radius of the droplets, and variance of the blur.
    shadows : int
        That were asked.
    """

    along_px2: float
    mixed_px2: float
    sd_px2: float
    square_px2: float
    blur_px2: float
    shadows: int

    @classmethod
    def together(cls, several: "Sequence[Elongation]") -> "Elongation":
        """Of the same view in several exposures, each with the weight of its shadows."""
        counts = np.array([one.shadows for one in several])
        shares = counts / counts.sum()
        rows = np.array([(one.along_px2, one.mixed_px2, one.square_px2, one.blur_px2) for one in several])
        along_px2, mixed_px2, square_px2, blur_px2 = (shares @ rows).tolist()
        sd_px2 = float(np.linalg.norm(shares * [one.sd_px2 for one in several]))
        return cls(along_px2, mixed_px2, sd_px2, square_px2, blur_px2, int(counts.sum()))


def seen_elongation(
    image: Image, trust: Image, centres_px: FloatArray, radii_px: FloatArray, lumps: Labels, blur_px: float
) -> Elongation | None:
    """Of the shadows in an image; None where few stand alone.

    Parameters
    ----------
    image, trust : (rows, columns) float32 arrays
        Light over that without droplets, and how sure pixels are: 0 where nothing is known.
    centres_px : (N, 2) array
        Of the droplets, (u, v).
    radii_px, lumps : (N,) arrays
        Theirs, and which of them are one droplet.
    blur_px : float
        Standard deviation of the blur.
    """
    centres_px, reaches_px = _whole(centres_px, radii_px, lumps, blur_px)
    alone = _alone(centres_px, reaches_px)
    told = [_moments(image, trust, centres_px[one], reaches_px[one]) for one in alone[:: -(-len(alone) // MOST) or 1]]
    rows = np.array([one for one in told if one is not None]).reshape(-1, 3)
    if len(rows) < FEWEST:
        return None
    area, sums = rows[:, 0], rows[:, 1:]
    mean = sums.sum(axis=0) / area.sum()
    sd = np.sqrt(np.sum((sums - area[:, None] * mean) ** 2, axis=0)) / area.sum()
    square_px2 = float(np.sum(area**2) / np.pi / area.sum())
    return Elongation(float(mean[0]), float(mean[1]), float(sd.max()), square_px2, blur_px**2, len(rows))


def lumps_of(positions: FloatArray, radii: FloatArray) -> Labels:
    """Which droplets (N, 3) are one: those that overlap in space, numbered from 0."""
    pairs = cKDTree(positions).query_pairs(2 * float(radii.max(initial=0)), output_type="ndarray")
    apart = np.linalg.norm(positions[pairs[:, 0]] - positions[pairs[:, 1]], axis=1)
    own, other = pairs[apart < radii[pairs].sum(axis=1)].T
    graph = csr_array((np.ones(len(own)), (own, other)), (len(radii), len(radii)))
    return np.asarray(connected_components(graph, directed=False)[1], np.intp)


def elongation_told(views: Sequence[Elongation]) -> tuple[str, bool]:
    """What is told of shadows that are longer than wide, and whether sizes are wrong; empty where they are round.

    Parameters
    ----------
    views : sequence of Elongation
        Of all views that tell.
    """
    if sum(one.shadows for one in views) < LEAST_SHADOWS:
        return "", False
    along, mixed, sd = (
        np.array([getattr(one, name) for one in views]) for name in ("along_px2", "mixed_px2", "sd_px2")
    )
    longer = float(np.sqrt(max(np.mean(along**2 + mixed**2 - 2 * sd**2), 0.0)))
    surely = longer - SURE * float(np.sqrt(np.mean(sd**2) / len(views)))
    ratio = 1 + 2 * longer / float(np.mean([one.square_px2 for one in views]))
    if surely <= 0 or ratio < LEAST_RATIO:
        return "", False
    is_wrong = surely > MOST_LONGER * float(np.mean([one.blur_px2 for one in views])) and ratio > MOST_RATIO
    return (
        f"shadows are longer than wide in the mean, as if smeared by {np.sqrt(12 * longer):.2g} px or of ovals "
        f"{100 * (ratio - 1):.0f} % longer than wide: do droplets move while the light is on, are they flattened, or "
        "is a lens astigmatic?"
    ), is_wrong


def judged_by_length(
    exposure: MeasuredExposure[Rows, Seen], views: Sequence[Elongation | None]
) -> MeasuredExposure[Rows, Seen]:
    """An exposure, doubtful where shadows are so much longer than wide that sizes are wrong."""
    reason, is_wrong = elongation_told([one for one in views if one is not None])
    return exposure.doubted((f"{reason}{WRONG}",)) if is_wrong else exposure


def _whole(
    centres_px: FloatArray, radii_px: FloatArray, lumps: Labels, blur_px: float
) -> tuple[FloatArray, FloatArray]:
    """Centres of lumps, and how far around their light is taken."""
    counts = np.bincount(lumps)
    whole = np.column_stack([np.bincount(lumps, along) for along in centres_px.T]) / counts[:, None]
    reaches_px = np.zeros(len(counts))
    np.maximum.at(reaches_px, lumps, np.linalg.norm(centres_px - whole[lumps], axis=1) + radii_px)
    return whole, reaches_px + 3 * blur_px + 1


def _alone(centres_px: FloatArray, reaches_px: FloatArray) -> Labels:
    """Which are reached by no other one: neighbours, which may stand in a row, would make them longer."""
    pairs = cKDTree(centres_px).query_pairs(2 * float(reaches_px.max(initial=0)), output_type="ndarray")
    apart = np.linalg.norm(centres_px[pairs[:, 0]] - centres_px[pairs[:, 1]], axis=1)
    return np.setdiff1d(np.arange(len(centres_px)), pairs[apart < reaches_px[pairs].sum(axis=1)])


def _moments(image: Image, trust: Image, centre_px: FloatArray, reach_px: float) -> tuple[float, float, float] | None:
    """Area of a shadow, and its two moments of length; None where a part of it is not known."""
    first, last = np.floor(centre_px - reach_px).astype(int), np.ceil(centre_px + reach_px).astype(int) + 1
    if first.min() < 0 or np.any(last > image.shape[::-1]):
        return None
    at = np.s_[first[1] : last[1], first[0] : last[0]]
    row, column = np.mgrid[at]
    taken = np.where(np.hypot(column - centre_px[0], row - centre_px[1]) <= reach_px, 1.0 - image[at], 0.0)
    if (area := float(taken.sum())) <= 0 or not np.all(trust[at] > 0):
        return None
    u, v = column - np.sum(taken * column) / area, row - np.sum(taken * row) / area
    return area, float(np.sum(taken * (u**2 - v**2))), float(np.sum(taken * 2 * u * v))
