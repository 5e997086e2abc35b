"""Whether all views see something: else droplets are not looked for. Images that fit no view are refused."""

from collections.abc import Sequence

import numpy as np

from processing.analysis.droplets.droplet_search import DropletSearch
from processing.analysis.droplets.gaussian_blobs import Image
from processing.analysis.droplets.measured_exposure import ShotVerdict
from processing.analysis.smooth_level import smooth_level
from processing.geometry import FloatArray

LIT_SIGMAS, LIT_PIXELS = 6.0, 4
"""A view that has fewer pixels so many standard deviations of its noise above the level around sees nothing."""
SMOOTH_PX = 41
"""What varies over more is light, and no droplet."""


def check_images(images: Sequence[Image], search: DropletSearch) -> None:
    """Refuse images that do not fit their views.

    Raises
    ------
    ValueError
        Their number or shape is another, or a pixel is not finite.
    """
    if len(images) != len(search.names):
        raise ValueError(f"{len(images)} images for {len(search.names)} views")
    for name, image, view in zip(search.names, images, search.plan.views, strict=True):
        if np.shape(image) != view.image_size_px[::-1]:
            raise ValueError(f"{name}: its image has shape {np.shape(image)}, its view {view.image_size_px[::-1]}")
        if not np.isfinite(image).all():
            row, column = np.argwhere(~np.isfinite(image))[0]
            raise ValueError(f"{name}: pixel (column {column}, row {row}) is {image[row, column]}")


def blind_views(bright: Sequence[Image], noises: FloatArray, names: Sequence[str]) -> tuple[str, ...]:
    """Names of the views that see nothing, from images in which droplets are bright."""
    return tuple(
        name
        for name, image, noise in zip(names, bright, noises, strict=True)
        if np.count_nonzero(image - smooth_level(image, SMOOTH_PX) > LIT_SIGMAS * noise) < LIT_PIXELS
    )


def blind_verdict(
    bright: Sequence[Image], noises: FloatArray, names: Sequence[str]
) -> tuple[ShotVerdict, tuple[str, ...]] | None:
    """Verdict and reasons where some views see nothing, or all, from images in which droplets are bright; else None."""
    blind = blind_views(bright, noises, names)
    if not blind:
        return None
    if len(blind) == len(names):
        return _without_droplets([-image for image in bright], noises, names)
    reason = (
        f"{', '.join(blind)} sees nothing while the others see droplets: is a lens covered, or a light off? "
        "Measure without the view, by a calibration that has only the others"
    )
    return ShotVerdict.REFUSED, (reason,)


def _without_droplets(
    dark: Sequence[Image], noises: FloatArray, names: Sequence[str]
) -> tuple[ShotVerdict, tuple[str, ...]]:
    """Nothing is as droplets are; if all views see spots in images that are turned over, something was mistaken."""
    if blind_views(dark, noises, names):
        return ShotVerdict.EMPTY, ("no view sees a droplet",)
    reason = (
        "all views see spots, and none is as droplets are: is the polarity another (shadow, bright), or are there "
        "droplets in the dark image or the background?"
    )
    return ShotVerdict.REFUSED, (reason,)
