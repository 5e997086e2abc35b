"""A camera's sensor: from light to grey values, with shot noise, read noise, dark level and saturation."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from processing.synthetic.stamping import FloatImage

Image = NDArray[np.uint8] | NDArray[np.uint16]


@dataclass(frozen=True)
class Sensor:
    """An interline-transfer CCD as PIV cameras have it.

    Parameters
    ----------
    full_well_e : float
        Electrons at the largest grey value.
    read_noise_e : float
        Standard deviation of the read-out.
    dark_level : float
        Offset of a dark image, as a fraction of the largest grey value.
    ambient_b : float
        Room light that the long exposure B collects, as a fraction of the largest grey value.
    """

    full_well_e: float = 20_000
    read_noise_e: float = 16
    dark_level: float = 0.02
    ambient_b: float = 0.01


def camera_image(light: FloatImage, sensor: Sensor, bits: int, rng: np.random.Generator) -> Image:
    """Grey values of an exposure.

    Shot noise is Gaussian of equal variance: from 100 electrons on nothing tells it from Poisson's, and below
    read noise prevails.

    Parameters
    ----------
    light : (row, column) float32 array
        Collected light; 1 fills the sensor.
    sensor : Sensor
        Noise, dark level, full well.
    bits : int
        Significant bits of a grey value, 8 to 16.
    rng : numpy Generator
        Source of the noise.

    Returns
    -------
    (row, column) uint8 array, uint16 from 9 bits on
        Grey values 0..2^bits - 1.
    """
    if not 8 <= bits <= 16:
        raise ValueError(f"bits must be 8 to 16, not {bits}")
    largest = 2**bits - 1
    electrons = light * np.float32(sensor.full_well_e)
    noise = rng.standard_normal(light.shape, dtype=np.float32)
    noise *= np.sqrt(electrons + np.float32(sensor.read_noise_e**2))
    electrons += noise
    electrons *= np.float32(largest / sensor.full_well_e)
    electrons += np.float32(sensor.dark_level * largest + 0.5)
    np.clip(electrons, 0, largest, out=electrons)
    return electrons.astype(np.uint8) if bits <= 8 else electrons.astype(np.uint16)
