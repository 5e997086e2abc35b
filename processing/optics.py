"""What lens, light and sensor allow: diffraction, depth of field, blur. Pure functions."""

GREEN_UM = 0.50
"""Wavelength of the light; with it eq. 1 reproduces d_A of Table 1."""


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
