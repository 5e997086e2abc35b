"""What becomes of a spot that has an outline: a droplet, several, or one that cannot be sized."""

from dataclasses import dataclass, field

import numpy as np

from processing.analysis.flat.blurred_disc import unblurred
from processing.analysis.flat.discs_in_outline import Disc, discs_in
from processing.analysis.flat.edge_residuals import ToldDisc
from processing.analysis.flat.flat_settings import FlatSettings
from processing.analysis.flat.outline import Outline
from processing.geometry import FloatArray


@dataclass(frozen=True)
class MeasuredSpot:
    """A droplet: column, row, diameter, raw diameter, blur, depth, circularity, overlapping; what makes it a circle."""

    row: tuple[float, ...]
    stretch: FloatArray = field(default_factory=lambda: np.eye(2))

    @property
    def overlapping(self) -> bool:
        """Whether another shadow reaches into its outline."""
        return self.row[-1] > 0

    @property
    def disc(self) -> ToldDisc | None:
        """What it looks like; None where it is one of several discs that make an outline together."""
        column, row, diameter_px, _, blur_px, depth, *_ = self.row
        return None if np.isnan(blur_px) else ToldDisc(row, column, diameter_px / 2, blur_px, depth, self.stretch)


@dataclass(frozen=True)
class LeftOut:
    """A spot that is no measured droplet.

    Parameters
    ----------
    reason : str
        Why; as in ``FlatDroplets.left_out``.
    diameter_px : float | None
        About how large it is, where it is a droplet that is too small or not sharp enough to be sized.
    """

    reason: str
    diameter_px: float | None = None


@dataclass(frozen=True)
class SeenSpot:
    """A spot with its outline at half depth, radii at all levels, depth, and whether another shadow reaches into it."""

    outline: Outline
    radii_px: tuple[float, float, float]
    depth: float
    disturbed: bool


def judged_spot(seen: SeenSpot, how: FlatSettings) -> list[MeasuredSpot | LeftOut]:
    """The droplet of a spot, the discs that make it together, or why it is none."""
    circularity, raw_px = min(seen.outline.circularity, 1.0), 2 * seen.outline.radius_px
    if raw_px < how.least_diameter_px:
        return [LeftOut("small", raw_px)]
    if circularity < how.least_circularity:
        discs = discs_in(seen.outline)
        return [_overlapping(disc, seen.depth, circularity) for disc in discs] or [LeftOut("not_round")]
    radius_px, blur_px = unblurred(seen.radii_px)
    if blur_px > how.most_blur * radius_px:
        return [LeftOut("unsharp", 2 * radius_px)]
    row, column = seen.outline.centre_px
    disturbed = float(seen.disturbed)
    told = (column, row, 2 * radius_px, raw_px, blur_px, seen.depth, circularity, disturbed)
    return [MeasuredSpot(told, seen.outline.stretch)]


def _overlapping(disc: Disc, depth: float, circularity: float) -> MeasuredSpot:
    diameter_px = 2 * disc.radius_px
    return MeasuredSpot((disc.column, disc.row, diameter_px, diameter_px, np.nan, depth, circularity, 1.0))
