"""Shadow images of a spray: opaque balls are dark discs that unite and are blurred; film lets light through.

The focal plane of every view is the plane z = 0: its Scheimpflug adaptor is adjusted to the target at z = 0.
"""

from dataclasses import replace

import numpy as np

from processing.geometry import PinholeCamera
from processing.synthetic.coherence import with_coherence
from processing.synthetic.spray import Spray
from processing.synthetic.stamping import Discs, FloatArray, FloatImage, stamp_discs
from processing.synthetic.union import QUICK, Sampling, blurred_union
from processing.synthetic.view_optics import PIXEL_VARIANCE_PX2, ViewOptics


def render_transmittance(
    camera: PinholeCamera,
    spray: Spray,
    optics: ViewOptics,
    exposure_s: float = 0.0,
    sampling: Sampling = QUICK,
) -> FloatImage:
    """Transmittance of a spray as one view sees it.

    Balls are discs around their projected centres. Opaque ones unite, and the union is blurred (``union``); those
    of a film, with an opacity below 1, multiply with each other and with the union. Refraction, the bright spots in
    the middle of large droplets, and perspective's ellipticity (below 0.3 %) are left out.

    Parameters
    ----------
    camera : PinholeCamera
        Projection, distortion included.
    spray : Spray
        The liquid in the middle of the exposure.
    optics : ViewOptics
        Diffraction and defocus; partially coherent light if it has a ``condenser_ratio``.
    exposure_s : float
        Duration of the light pulse: moving balls are smeared along their path.
    sampling : Sampling
        ``QUICK`` for cameras, ``ACCURATE`` for truth that measurements are compared with.

    Returns
    -------
    (row, column) float32 array
        1 where light passes, 0 in full shadow.
    """
    path_mm = 0.5 * exposure_s * spray.velocities_mm_per_s
    first_px = camera.project(spray.positions_mm - path_mm)[:, ::-1]
    last_px = camera.project(spray.positions_mm + path_mm)[:, ::-1]
    depths_mm = depth_out_of_focus_mm(camera, spray.positions_mm)
    discs = Discs(
        centres=0.5 * (first_px + last_px),
        radii_px=0.5 * spray.diameters_mm * image_scale_px_per_mm(camera, spray.positions_mm),
        sigmas_px=np.copysign(optics.defocus_sigma_px(depths_mm), depths_mm),
        opacities=spray.opacities,
        smears=last_px - first_px,
    )
    width_px, height_px = camera.image_size_px
    faint = spray.opacities < 1
    film = replace(discs, sigmas_px=optics.blur_sigma_px(depths_mm)).select(np.flatnonzero(faint))
    transmittance = _union(discs.select(np.flatnonzero(~faint)), optics, (height_px, width_px), sampling)
    transmittance *= stamp_discs(film, (height_px, width_px))
    return transmittance


def _union(opaque: Discs, optics: ViewOptics, shape: tuple[int, int], sampling: Sampling) -> FloatImage:
    """Transmittance of opaque discs in the light of a view."""
    transmittance = blurred_union(opaque, optics.diffraction_sigma_px, shape, sampling)
    if optics.condenser_ratio is None:
        return transmittance
    with_pixel = replace(opaque, sigmas_px=np.sqrt(opaque.sigmas_px**2 + PIXEL_VARIANCE_PX2))
    return with_coherence(transmittance, with_pixel, optics.airy_px, optics.condenser_ratio)


def image_scale_px_per_mm(camera: PinholeCamera, points_mm: FloatArray) -> FloatArray:
    """Local image scale at points (N, 3), in the plane across the view axis; distortion changes it by < 1 %."""
    depths_mm = points_mm @ camera.rotation[2] + camera.translation_mm[2]
    return np.asarray(camera.camera_matrix[0, 0] / depths_mm, dtype=np.float64)


def depth_out_of_focus_mm(camera: PinholeCamera, points_mm: FloatArray) -> FloatArray:
    """Distance (N,) of points (N, 3) from the focal plane z = 0 along their line of sight, as depth of the view."""
    rays = camera.ray_directions(points_mm)
    return np.asarray(points_mm[:, 2] * (rays @ camera.rotation[2]) / rays[:, 2], dtype=np.float64)
