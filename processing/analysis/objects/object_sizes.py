"""How long and wide objects of a class are: medians, with intervals over shots, as droplets' diameters have them."""

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from processing.analysis.estimates import COUNTED_DRAWS, FEW_SHOTS, Estimate, Figures, estimated, weighted_quantiles
from processing.analysis.objects.liquid_objects import LiquidObjects, ObjectClass
from processing.geometry import FloatArray
from processing.reconstruction.settings import FrozenValue

FEWEST = 5
"""Objects of a class whose median is told with an interval."""


class MedianSizes(FrozenValue):
    """Of the objects of a class; intervals are over shots, of a single shot over its objects."""

    length_mm: Annotated[Estimate, Field(description="along the longest axis")]
    width_mm: Annotated[Estimate, Field(description="along the middle axis")]


def median_sizes(shots: Sequence[LiquidObjects], kind: ObjectClass, exposures: int) -> MedianSizes | None:
    """Median length and width of the objects of a class; None of fewer than five.

    Parameters
    ----------
    shots : sequence of LiquidObjects
        A shot each, of all its exposures.
    kind : ObjectClass
        Which objects.
    exposures : int
        Of all shots: A and B of a shot show the same objects.
    """
    chosen = [one.where(one.classes == kind) for one in shots]
    sizes_mm = np.concatenate([np.empty((0, 2)), *(np.column_stack([one.lengths_mm, one.widths_mm]) for one in chosen)])
    if len(sizes_mm) < FEWEST:
        return None
    shot = np.repeat(np.arange(len(shots)), list(map(len, chosen)))
    length, width = _estimated(sizes_mm, shot, len(shots), exposures / len(shots))
    return MedianSizes(length_mm=length, width_mm=width) if length and width else None


def _estimated(
    values: FloatArray, shot: NDArray[np.intp], shots: int, exposures_per_shot: float
) -> list[Estimate | None]:
    """Medians of columns (N, k); of few shots they are no surer than those over objects."""
    n = len(values)
    told = estimated(_medians(values, shot), shots, n)
    if len(np.unique(shot)) >= FEW_SHOTS:
        return told
    widening = float(np.sqrt(exposures_per_shot))
    by_object = estimated(_medians(values, np.arange(n)), n, n, counting=True, number=COUNTED_DRAWS, widening=widening)
    return [one.no_surer_than(other) if one else other for one, other in zip(told, by_object, strict=True)]


def _medians(values: FloatArray, units: NDArray[np.intp]) -> Figures:
    """Of columns (N, k), each value taken as often as its unit is."""
    orders = np.argsort(values, axis=0, kind="stable").T

    def figures(counts: FloatArray) -> FloatArray:
        return np.column_stack([_median(values[order, k], counts[:, units[order]]) for k, order in enumerate(orders)])

    return figures


def _median(values: FloatArray, weights: FloatArray) -> FloatArray:
    """Of sorted values: midway between those below which, and above which, half of the weight lies."""
    below = weighted_quantiles(values, weights, (0.5,))
    above = -weighted_quantiles(-values[::-1], weights[:, ::-1], (0.5,))
    return np.asarray((below + above)[:, 0] / 2)
