"""What the views of an exposure of shadows look like: noise, blur, shifts, light, masks, elongation."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from processing.analysis.droplets.droplet_search import DropletSearch
from processing.analysis.droplets.shadows.shadow_fit import ShadowFit, Transmissions
from processing.analysis.droplets.verdicts.elongation import Elongation, lumps_of, seen_elongation
from processing.optics import LEAST_SHADOW, shadow_diameter_px

NOISES, MOST_SHADOW = 4.0, 0.9
"""Standard deviations of the noise that a shadow must take of the light, if that is more than ``LEAST_SHADOW``, to be
found for sure: with 3 % noise 98 % of the droplets from 16 um on are, which take 12 %. None is darker than black."""


@dataclass(frozen=True)
class SeenShadows:
    """What a view of an exposure looks like.

    Parameters
    ----------
    noise, level : float
        Standard deviation of the noise of a pixel, and transmission without droplets.
    blur_px, focus_z_mm : float
        Standard deviation of the blur where it is least, and where that is.
    most_blur_px : float
        Where it is largest within the grid.
    shift_u_px, shift_v_px : float
        How far the image lies beside its calibration, apart from a common motion of all.
    masked : float
        Share of the pixels into the grid that look through liquid that is no droplet.
    condenser_ratio : float | None
        Numerical aperture of the light over that of the lens, the same for all views; None: blur is Gaussian.
    light_sd_um : float
        Standard deviation that all diameters share because the light is not known better, the same for all views.
    elongation : Elongation | None
        How much longer than wide shadows are; None where few stand alone.
    complete_from_um : float
        Diameter from which on droplets show: their shadow takes ``LEAST_SHADOW`` of the light, or four standard
        deviations of the noise. 0: a file of an older program does not tell.
    """

    noise: float
    level: float
    blur_px: float
    focus_z_mm: float
    most_blur_px: float
    shift_u_px: float
    shift_v_px: float
    masked: float
    condenser_ratio: float | None = None
    light_sd_um: float = 0.0
    elongation: Elongation | None = None
    complete_from_um: float = 0.0


def seen_shadows(
    shot: Transmissions, fit: ShadowFit, search: DropletSearch, into_grid: Sequence[NDArray[np.bool_]]
) -> dict[str, SeenShadows]:
    """What the views look like, by name.

    Parameters
    ----------
    shot, fit, search : Transmissions, ShadowFit, DropletSearch
        What was recorded, what is known of it, and where droplets were looked for.
    into_grid : sequence of (rows, columns) bool arrays
        Pixels of each view that look into the grid.
    """
    margin = (search.searched.shape[0] - search.grid.shape[0]) // 2
    z_voxel = margin + np.arange(search.grid.shape[0], dtype=np.float64)
    blurs_px = fit.optics.blurs_px(z_voxel)
    rows = np.column_stack(
        [
            fit.noises,
            fit.optics.levels,
            blurs_px.min(axis=1),
            search.grid.z_mm[blurs_px.argmin(axis=1)],
            blurs_px.max(axis=1),
            fit.optics.shifts_px,
            _masked_shares(fit, into_grid),
        ]
    )
    ratio, sd_um = fit.optics.condenser_ratio, 2000 * fit.light.radius_sd * search.searched.pitch_mm
    um_per_px = 1000 * search.searched.pitch_mm / shot.lattice.pixels_per_voxel
    limits_um = [um_per_px * _limit_px(noise, blur_px) for noise, blur_px in rows[:, [0, 4]].tolist()]
    views = zip(search.names, rows.tolist(), _elongations(shot, fit), limits_um, strict=True)
    return {
        name: replace(
            SeenShadows(*row), condenser_ratio=ratio, light_sd_um=sd_um, elongation=longer, complete_from_um=limit_um
        )
        for name, row, longer, limit_um in views
    }


def _limit_px(noise: float, blur_px: float) -> float:
    """Diameter of a disc whose middle, behind the blur, is as dark as droplets must be to be found."""
    return shadow_diameter_px(blur_px, min(max(LEAST_SHADOW, NOISES * noise), MOST_SHADOW))


def _masked_shares(fit: ShadowFit, into_grid: Sequence[NDArray[np.bool_]]) -> list[float]:
    if not fit.masks:
        return [0.0] * len(into_grid)
    return [float(np.mean(mask[chosen])) for mask, chosen in zip(fit.masks, into_grid, strict=True)]


def _elongations(shot: Transmissions, fit: ShadowFit) -> list[Elongation | None]:
    """Of the shadows of every view."""
    places, radii_px = fit.discs.positions_voxel, fit.discs.radii_voxel * shot.lattice.pixels_per_voxel
    known, lumps = shot.masked(fit.masks).trust, lumps_of(places, fit.discs.radii_voxel)
    blurs_px = fit.optics.blurs_px(0.5 * (shot.lattice.nodes_px.shape[1] - 1) * shot.lattice.spacing)
    views = zip(shot.images, fit.optics.levels, known, shot.lattice.seen_px(places), blurs_px, strict=True)
    return [
        seen_elongation(image / np.float32(level), trust, centres_px, radii_px, lumps, float(blur_px))
        for image, level, trust, centres_px, blur_px in views
    ]
