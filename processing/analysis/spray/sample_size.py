"""SampleVerdict: whether there are enough droplets, and whether a single one decides.

ASTM E799 asks for a sample that is large enough, and that no extreme drop carries the result. Here droplets come in
shots, and those of one are not independent: the size of the sample is judged by the interval over shots, and the
extreme drop by its share of the volume. **The limit of 2 % is measured, not the standard's**: below it, 90 % intervals
of D32, Dv0.5, span and flux of 3 to 40 shots hold the truth in 85 to 90 %, from 2 to 4 % in 80 to 88 %, beyond in 50
to 83 % (``docs/spray.md``).
"""

from math import ceil, sqrt
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from processing.analysis.droplets.size_statistics import SizeStatistics
from processing.analysis.droplets.sizes_in_light import by_shots
from processing.analysis.estimates import CONFIDENCE, MANY, Estimate, reach
from processing.analysis.spray.spray_sample import SpraySample
from processing.reconstruction.settings import FrozenValue

MOST_EXTREME = 0.02
"""Share of the volume in the largest droplet."""
LARGEST_HALF_WIDTH = 0.05
"""Of the 95 % interval of D32, over its value, of a sample that is adequate."""
FEWEST_SHOTS = 5
"""Student's t of fewer is above 2.8, and says little of how shots differ."""


class SampleVerdict(FrozenValue):
    """Whether the sample is large enough for its diameters to be believed to 5 %."""

    verdict: Annotated[
        Literal["adequate", "low sample"], Field(description="low sample: intervals may be too narrow, see reasons")
    ]
    reasons: Annotated[tuple[str, ...], Field(description="why it is low, and what to do")]
    extreme_share: Annotated[
        float | None, Field(description="of the volume, in the largest droplet; null without diameters")
    ]
    extreme_um: Annotated[float | None, Field(description="its diameter")]
    d32_without_extreme_um: Annotated[float | None, Field(description="D32 when it is left out")]
    d32_half_width: Annotated[float | None, Field(description="of the 95 % interval of D32, over its value")]
    shots_for_5_percent: Annotated[
        int | None, Field(description="that a half width of 5 % would take, as these shots scatter")
    ]


def sample_verdict(sample: SpraySample, sizes: SizeStatistics) -> SampleVerdict:
    """Judge the size of a sample.

    Parameters
    ----------
    sample : SpraySample
        The droplets.
    sizes : SizeStatistics
        Their diameters, with 95 % intervals.
    """
    half_width, shots_alone = _half_width(sizes.d32_um), _half_width(by_shots(sizes, "d32_um"))
    share, largest_um, without_um = extreme_droplet(sample)
    needed = None
    if shots_alone is not None and sizes.intervals_over == "shots":
        counted = sizes.shots * (_counted_half_width(sample) / LARGEST_HALF_WIDTH) ** 2
        needed = max(shots_needed(shots_alone, sizes.shots), ceil(counted), FEWEST_SHOTS)
    reasons = tuple(_reasons(sizes, share, half_width, needed))
    return SampleVerdict(
        verdict="low sample" if reasons else "adequate",
        reasons=reasons,
        extreme_share=share,
        extreme_um=largest_um,
        d32_without_extreme_um=without_um,
        d32_half_width=half_width,
        shots_for_5_percent=needed,
    )


def shots_needed(half_width: float, shots: int) -> int:
    """How many shots a half width of 5 % takes, where so many have another one: its Student's t falls with them.

    Parameters
    ----------
    half_width : float
        Of the 95 % interval over its value.
    shots : int
        That it is of, two at least.
    """
    scatter = half_width * sqrt(shots) / reach(shots)
    needed = max(ceil((scatter * reach(MANY) / LARGEST_HALF_WIDTH) ** 2), 2)
    while scatter * reach(needed) > LARGEST_HALF_WIDTH * sqrt(needed):
        needed += 1
    return needed


def _half_width(d32: Estimate | None) -> float | None:
    return None if d32 is None else float(np.log(d32.high / d32.low) / 2)


def _counted_half_width(sample: SpraySample) -> float:
    """Of D32 over its value, if nothing but the number of droplets were left to chance; two exposures are one."""
    cubes, squares = sample.cubes_um3, sample.diameters_um**2
    weights = cubes / cubes.sum() - squares / squares.sum()
    return reach(MANY) * float(np.sqrt(sample.exposures_per_shot * np.sum(weights**2)))


def extreme_droplet(sample: SpraySample) -> tuple[float | None, float | None, float | None]:
    """Share of the volume and diameter of the largest droplet, and D32 without it; two exposures show it twice."""
    if not len(sample):
        return None, None, None
    d_um = sample.diameters_um
    share = sample.exposures_per_shot * d_um.max() ** 3 / np.sum(d_um**3)
    others_um = np.sort(d_um)[: -max(round(sample.exposures_per_shot), 1)]
    without_um = float(np.sum(others_um**3) / np.sum(others_um**2)) if len(others_um) else None
    return min(float(share), 1.0), float(d_um.max()), without_um


def _reasons(sizes: SizeStatistics, share: float | None, half_width: float | None, needed: int | None) -> list[str]:
    reasons = []
    if sizes.shots < FEWEST_SHOTS:
        few = f"shots with droplets: {sizes.shots}, which say little of how shots differ"
        reasons.append(f"{few}; measure {FEWEST_SHOTS} at least")
    if share is not None and share > MOST_EXTREME:
        reasons.append(
            f"the largest droplet has {100 * share:.1f} % of the volume, more than {100 * MOST_EXTREME:g} %: intervals "
            "of D32, and of quantiles by volume, are too narrow, as larger ones may be missing; measure more shots"
        )
    if half_width is None:
        reasons.append(sizes.reason or "there is no D32")
    elif half_width > LARGEST_HALF_WIDTH:
        more = f": about {needed} shots would do" if needed and needed > sizes.shots else ""
        if sizes.light_sd_um:
            more += (
                f"; all diameters share {sizes.light_sd_um:.1f} um (one standard deviation), as the light is not known "
                "better: state it (--light), or measure a reticle"
            )
        reasons.append(
            f"D32 is known to {ceil(1000 * half_width) / 10:g} % ({100 * CONFIDENCE:g} % confidence), not to "
            f"{100 * LARGEST_HALF_WIDTH:g} %{more}"
        )
    return reasons
