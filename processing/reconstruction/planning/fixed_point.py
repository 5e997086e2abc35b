"""FixedPoint: images as the kernels sample them, in 16 bit."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class FixedPoint:
    """An image of intensities; the brightest pixel of what it was made from has 32767 counts.

    Parameters
    ----------
    pixels : (rows, columns) int16 array
        Counts from 0 to 32767.
    unit : float
        Intensity of one count.
    """

    pixels: NDArray[np.int16]
    unit: float

    @property
    def brightest(self) -> float:
        """Largest intensity that the image could have."""
        return 32767 * self.unit

    @property
    def intensity(self) -> NDArray[np.float32]:
        """The image in floating point, (rows, columns)."""
        return self.pixels.astype(np.float32) * np.float32(self.unit)
