"""ViewOptics: lens, sensor pitch and light of one view (Table 1), and the blur they cause."""

from dataclasses import dataclass

import numpy as np

from processing.coherent_light import CORE_SIGMA
from processing.optics import GREEN_UM, airy_diameter_um
from processing.synthetic.stamping import FloatArray

PIXEL_VARIANCE_PX2 = 1 / 12
"""Variance of a pixel of full fill factor."""


@dataclass(frozen=True)
class ViewOptics:
    """Lens, sensor and light of one view.

    Parameters
    ----------
    f_number, focal_length_mm, magnification : float
        Lens.
    pixel_pitch_um : float
        Pitch of the sensor.
    nominal_current_a : float
        LED current that exposes half of the dynamic range within 1 us.
    wavelength_um : float
        Wavelength of the light.
    condenser_ratio : float, optional
        Numerical aperture of the light over that of the lens, above 0 to 8, see ``coherence``; up to 1, light is
        partially coherent, and small droplets look larger. Without it diffraction is a Gaussian blur.
    """

    f_number: float
    focal_length_mm: float
    magnification: float
    pixel_pitch_um: float
    nominal_current_a: float
    wavelength_um: float = GREEN_UM
    condenser_ratio: float | None = None

    @property
    def airy_px(self) -> float:
        """Airy disk d_A of eq. 1 on the sensor."""
        return airy_diameter_um(self.f_number, self.magnification, self.wavelength_um) / self.pixel_pitch_um

    @property
    def diffraction_sigma_px(self) -> float:
        """Gaussian of equal core for the Airy disk."""
        return CORE_SIGMA * self.airy_px

    def defocus_sigma_px(self, depth_mm: FloatArray) -> FloatArray:
        """Blur of points ``depth_mm`` (N,) out of focus along the view axis, as a Gaussian, (N,).

        The blur circle in the object, depth x M / (f# (M + 1)), is a uniform disc: sigma = diameter / 4. The light
        of a real, collimated LED fills less than the aperture, and blurs less.
        """
        circle_mm = np.abs(depth_mm) * self.magnification / (self.f_number * (self.magnification + 1))
        return np.asarray(circle_mm * self.magnification * 1000 / self.pixel_pitch_um / 4, dtype=np.float64)

    def optical_sigma_px(self, depth_mm: FloatArray) -> FloatArray:
        """Diffraction and defocus as one Gaussian, (N,)."""
        return np.hypot(self.diffraction_sigma_px, self.defocus_sigma_px(depth_mm))

    def blur_sigma_px(self, depth_mm: FloatArray) -> FloatArray:
        """``optical_sigma_px`` with the area of the pixel, (N,)."""
        return np.sqrt(self.optical_sigma_px(depth_mm) ** 2 + PIXEL_VARIANCE_PX2)
