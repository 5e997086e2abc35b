"""Hidden: what of an exposure could not be measured, and where."""

from dataclasses import dataclass

from processing.analysis.cells import IsMeasured, Percent, measured_percent, measured_share


@dataclass(frozen=True)
class Hidden:
    """What could not be measured of an exposure.

    Parameters
    ----------
    liquid_objects : int
        Ligaments, sheets and other liquid that is no droplet, which is masked.
    volume_share : float
        Of the grid: what too few views can judge, as it lies in masked liquid, before or behind it, or beyond their
        images; of bright particles what not all views see.
    droplets : int
        That are seen, but by too few views to be told.
    measured_percent : dict of plane to rows | None
        Of the volume of each cell of a map, what was not hidden; None where nobody looked.
    """

    liquid_objects: int = 0
    volume_share: float = 0.0
    droplets: int = 0
    measured_percent: Percent | None = None

    @classmethod
    def of(
        cls, shape: tuple[int, int, int], is_measured: IsMeasured, liquid_objects: int = 0, droplets: int = 0
    ) -> "Hidden":
        """Ask places all over a grid, (z, y, x) voxels, whether they could be measured."""
        share = 1 - measured_share(is_measured)
        return cls(liquid_objects, share, droplets, measured_percent(shape, is_measured))
