"""What a reticle of dots says of diameters: found and true, and what lies between."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import AfterValidator

from processing.geometry import FloatArray

BEYOND_SHARE = 0.5
"""Of the correction of the last dots: how unsure it is for smaller and larger droplets than any dot."""

LEAST_SHARE = 0.5
"""Of a diameter, that is left of it."""

SizeRow = tuple[float, float, float]
"""Found, true, and standard deviation of their difference, in um."""


def _growing(rows: tuple[SizeRow, ...]) -> tuple[SizeRow, ...]:
    if any(min(row) <= 0 or not np.all(np.isfinite(row)) for row in rows):
        raise ValueError("sizes and their standard deviations are above 0, and finite")
    if any(np.diff([row[column] for row in rows]).min(initial=1) <= 0 for column in (0, 1)):
        raise ValueError("sizes must grow from row to row, found and true")
    return rows


SizeRows = Annotated[tuple[SizeRow, ...], AfterValidator(_growing)]


@dataclass(frozen=True, eq=False)
class SizeCorrection:
    """Diameters of the dots of a reticle.

    Parameters
    ----------
    found_um : (N,) array
        As they are measured, increasing.
    true_um : (N,) array
        As they are.
    sd_um : (N,) array
        Standard deviation of the difference.
    """

    found_um: FloatArray
    true_um: FloatArray
    sd_um: FloatArray

    @classmethod
    def of(cls, rows: tuple[SizeRow, ...]) -> "SizeCorrection":
        """By rows of found, true, and standard deviation."""
        return cls(*np.array(rows, dtype=np.float64).T)

    def corrected(self, diameters_um: FloatArray) -> FloatArray:
        """True diameters (N,): between two dots by their differences, beyond them by that of the last one.

        None becomes less than half as large, as droplets that are much smaller than any dot might else.
        """
        differences = np.interp(diameters_um, self.found_um, self.true_um - self.found_um)
        return np.asarray(np.maximum(diameters_um + differences, LEAST_SHARE * diameters_um), dtype=np.float64)

    def sd(self, diameters_um: FloatArray) -> FloatArray:
        """Standard deviation (N,) of the correction; beyond the dots half of it is added."""
        between = np.interp(diameters_um, self.found_um, self.sd_um)
        beyond = (diameters_um < self.found_um[0]) | (diameters_um > self.found_um[-1])
        last = np.interp(diameters_um, self.found_um, self.true_um - self.found_um)
        return np.asarray(np.hypot(between, BEYOND_SHARE * last * beyond), dtype=np.float64)
