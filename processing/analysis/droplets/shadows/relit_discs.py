"""Droplets that were fitted in one light, as they would be in another one."""

from dataclasses import replace

import numpy as np

from processing.analysis.droplets.shadows.discs.disc_profiles import disc_profiles
from processing.analysis.droplets.shadows.discs.opaque_discs import Discs
from processing.analysis.droplets.shadows.shadow_fit import ShadowFit

LEAST_SIZE, MOST_SIZE = 0.75, 1.33
"""Of radii in another light, relative: small discs are as dark."""


def relit(fit: ShadowFit, condenser_ratio: float | None, pixels_per_voxel: float) -> ShadowFit:
    """Droplets whose edges look in another light about as they did: where a fit to it begins.

    Parameters
    ----------
    fit : ShadowFit
        In its light.
    condenser_ratio : float | None
        Of the other light.
    pixels_per_voxel : float
        Scale of the images.
    """
    shift, width = disc_profiles(fit.optics.condenser_ratio).edge
    other_shift, other_width = disc_profiles(condenser_ratio).edge
    wider = width / other_width
    blurs_voxel = fit.optics.blurs_px(fit.discs.positions_voxel[:, 2]).mean(axis=0) / pixels_per_voxel
    radii = fit.discs.radii_voxel + (shift - wider * other_shift) * blurs_voxel
    radii = np.clip(radii, LEAST_SIZE * fit.discs.radii_voxel, MOST_SIZE * fit.discs.radii_voxel)
    variances = wider**2 * fit.optics.variances_px2
    optics = replace(fit.optics, variances_px2=variances, condenser_ratio=condenser_ratio)
    return replace(fit, optics=optics, discs=Discs(fit.discs.positions_voxel, radii**2))
