"""ClassDetection: which share of the droplets of a diameter is found, by twins, and how many there are then."""

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import Field

from processing.analysis.droplets.droplet_file import StoredDroplets
from processing.analysis.droplets.droplet_statistics import told_exposures
from processing.analysis.droplets.ghost_share import FoundOfClass, pooled_classes, share_interval
from processing.analysis.droplets.size_statistics import SizeClass, class_numbers, garwood
from processing.analysis.estimates import Estimate
from processing.reconstruction.settings import FrozenValue

LEAST_FOUND = 0.5
"""Where the share may be below, twins know too little of those that are missed: they are made of found droplets."""
NO_TWINS = "no twin tells what is found of which diameter; measure with --twins 1, or more for narrower intervals"
NONE_PLACED = "twins have no droplet of this class; measure with more of them (--twins), or more shots"
MAY_BE_FEW = "fewer than half may be found; measure with more twins (--twins), or do not trust droplets as small"


class ClassDetection(FrozenValue):
    """Droplets of a class of diameters, and how many there are."""

    low_um: Annotated[float, Field(description="smallest diameter, as of the classes of the spray")]
    high_um: Annotated[float, Field(description="largest diameter")]
    n: Annotated[int, Field(description="droplets that were found")]
    placed: Annotated[int, Field(description="droplets of twins, where they could be measured")]
    found_share: Annotated[Estimate | None, Field(description="of those; interval by counting")] = None
    n_corrected: Annotated[Estimate | None, Field(description="n over the share; interval by counting both")] = None
    reason: Annotated[str | None, Field(description="why there is none")] = None


def detection(
    shots: Sequence[StoredDroplets], classes: Sequence[SizeClass], exposures_per_shot: float = 1
) -> tuple[ClassDetection, ...] | None:
    """Detection by size; None where no twin tells of it.

    Parameters
    ----------
    shots : sequence of StoredDroplets
        Of the spray.
    classes : sequence of SizeClass
        What was found, as ``size_classes`` has it.
    exposures_per_shot : float
        2 where A and B, which show the same droplets, are both counted.
    """
    twins = [exposure.get("twins") or {} for shot in shots for exposure in told_exposures(shot)]
    stated = (one for twin in twins for one in twin.get("classes", ()))
    told = pooled_classes(FoundOfClass(one["number"], one["placed"], one["found"]) for one in stated)
    if not told:
        return None
    by_number = {one.number: one for one in told}
    return tuple(_of_class(one, by_number.get(_number(one)), exposures_per_shot) for one in classes)


def _number(one: SizeClass) -> int:
    return int(class_numbers([np.sqrt(one.low_um * one.high_um)])[0])


def _of_class(one: SizeClass, twins: FoundOfClass | None, exposures_per_shot: float) -> ClassDetection:
    counted = ClassDetection(low_um=one.low_um, high_um=one.high_um, n=one.n, placed=twins.placed if twins else 0)
    if twins is None or not twins.placed:
        return counted.model_copy(update={"reason": NONE_PLACED})
    low, high = share_interval(twins.found, twins.placed)
    share = Estimate(value=twins.found / twins.placed, low=low, high=high)
    if low < LEAST_FOUND:
        return counted.model_copy(update={"found_share": share, "reason": MAY_BE_FEW})
    return counted.model_copy(update={"found_share": share, "n_corrected": _over(one.n, share, exposures_per_shot)})


def _over(n: int, share: Estimate, exposures_per_shot: float) -> Estimate:
    """Limits of a ratio by those of its parts, as far from it as they are, added in squares (Donner and Zou)."""
    fewest, most = (exposures_per_shot * end for end in garwood(n / exposures_per_shot))
    value = n / share.value
    below = np.hypot((n - fewest) / share.value, value - n / share.high)
    above = np.hypot((most - n) / share.value, n / share.low - value)
    return Estimate(value=value, low=float(max(0.0, value - below)), high=float(value + above))
