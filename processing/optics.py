"""What lens, light and sensor allow: diffraction, depth of field, blur, the smallest droplet. Pure functions."""

import math

from processing.coherent_light import CORE_SIGMA

GREEN_UM = 0.50
"""Wavelength of the light; with it eq. 1 reproduces d_A of Table 1."""
LEAST_SHADOW = 0.08
"""Of the light: with 1.2 % noise and the paper's lenses 94 % of the droplets of 12 to 13 um, which take so much, are
found (10 per mm^3); with 3 % noise those from 16 um on."""
PIXEL_SIGMA = 12**-0.5
"""Standard deviation of a pixel's own width, in px."""


def airy_diameter_um(f_number: float, magnification: float, wavelength_um: float = GREEN_UM) -> float:
    """Diameter of the Airy disk on the sensor, ``d_A = 2.44 f# (M + 1) lambda`` (eq. 1).

    Parameters
    ----------
    f_number, magnification : float
        Aperture and magnification of the lens.
    wavelength_um : float
        Wavelength of the light in um.
    """
    return 2.44 * f_number * (magnification + 1) * wavelength_um


def resolved_diameter_um(f_number: float, magnification: float, wavelength_um: float = GREEN_UM) -> float:
    """Droplet diameter in the spray, d_A / M, below which the image shows diffraction instead of the droplet."""
    return airy_diameter_um(f_number, magnification, wavelength_um) / magnification


def smallest_droplet_um(airy_px: float, scale_px_per_mm: float) -> float:
    """Diameter of a droplet in focus whose shadow takes ``LEAST_SHADOW`` of the light in its middle.

    Behind a Gaussian blur as wide as the core of the Airy disk and a pixel together; smaller ones are mostly missed.

    Parameters
    ----------
    airy_px : float
        Diameter of the Airy disk.
    scale_px_per_mm : float
        Of the image.
    """
    blur_px = math.hypot(CORE_SIGMA * airy_px, PIXEL_SIGMA)
    return 1000 * shadow_diameter_px(blur_px, LEAST_SHADOW) / scale_px_per_mm


def shadow_diameter_px(blur_px: float, depth: float) -> float:
    """Diameter of an opaque disc that takes a share ``depth`` of the light in its middle, behind a Gaussian blur."""
    return 2 * blur_px * math.sqrt(-2 * math.log(1 - depth))


def depth_of_field_mm(f_number: float, magnification: float, wavelength_um: float = GREEN_UM) -> float:
    """Depth, near to far, in which defocus blurs less than the Airy disk: ``2 f# d_A (M + 1) / M^2``.

    Geometric optics of a thin lens with d_A of eq. 1 as the permitted circle of confusion, in mm.
    """
    permitted_um = airy_diameter_um(f_number, magnification, wavelength_um)
    return 2 * f_number * permitted_um * (magnification + 1) / magnification**2 / 1000


def image_scale_px_per_mm(magnification: float, pixel_pitch_um: float) -> float:
    """Pixels per mm of the object plane."""
    return magnification * 1000 / pixel_pitch_um


def travel_um(velocity_m_s: float, duration_ns: int) -> float:
    """Path in um of a droplet during a time: motion blur for a pulse width, displacement for a separation."""
    return velocity_m_s * duration_ns / 1000
