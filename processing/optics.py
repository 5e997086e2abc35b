"""What lens, light and sensor allow: diffraction, depth of field, blur, pulse separation. Pure functions."""

from dataclasses import dataclass

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


@dataclass(frozen=True)
class StraddlingWindow:
    """Pulse separations, start to start, that put pulse A into frame A and pulse B into frame B."""

    shortest_ns: int
    longest_ns: int


def straddling_window(
    *, width_ns: int, exposure_a_ns: int, gap_ns: int, exposure_b_ns: int, guard_ns: int
) -> StraddlingWindow:
    """Shortest and longest pulse separation of a double-frame camera.

    Parameters
    ----------
    width_ns : int
        Pulse duration tau_p.
    exposure_a_ns, gap_ns, exposure_b_ns : int
        Exposure A, the blind time after it, exposure B.
    guard_ns : int
        Distance that light keeps from either end of an exposure.

    Raises
    ------
    ValueError
        A pulse and its guards do not fit into one of the exposures.
    """
    lit_ns = width_ns + 2 * guard_ns
    if lit_ns > min(exposure_a_ns, exposure_b_ns):
        raise ValueError(
            f"width_ns: {width_ns} ns and 2 x guard {guard_ns} ns do not fit the shorter exposure, "
            f"{min(exposure_a_ns, exposure_b_ns)} ns"
        )
    return StraddlingWindow(
        shortest_ns=lit_ns + gap_ns,
        longest_ns=exposure_a_ns + gap_ns + exposure_b_ns - lit_ns,
    )
