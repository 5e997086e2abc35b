"""The fit of droplets to the transmissions of an exposure, from round to round."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from processing.analysis.droplets.droplet_search import Window
from processing.analysis.droplets.gaussian_blobs import Image
from processing.analysis.droplets.image_noise import LEAST_NOISE, noise_of
from processing.analysis.droplets.shadows.discs.opaque_discs import DiscImages, DiscOptics, Discs
from processing.analysis.droplets.shadows.light.seen_light import STATED, SeenLight
from processing.analysis.droplets.shadows.masked_liquid import Mask
from processing.analysis.droplets.sight_lattice import SightLattice
from processing.geometry import FloatArray

AnyPixel = TypeVar("AnyPixel", bound=np.generic)
NO_DISCS = Discs.none()
CALIBRATION_PX = 0.03
"""What calibration and lattice leave of a position: where the model has edges, it is an error of the image."""


@dataclass(frozen=True, eq=False)
class Transmissions:
    """Transmissions of all views as they were recorded.

    Parameters
    ----------
    images : tuple of (rows, columns) float32 arrays
        Their pixels.
    trust : tuple of (rows, columns) float32 arrays
        How sure pixels are: inverse variances, 1 for a typical one, 0 where nothing is known.
    lattice : SightLattice
        Of the same views.
    threads : int
        Nothing depends on it.
    windows : tuple of (rows, columns) slices
        What these are of the recorded images; empty: all of them. The lattice is that of the windows.
    """

    images: tuple[Image, ...]
    trust: tuple[Image, ...]
    lattice: SightLattice
    threads: int = 1
    windows: tuple[Window, ...] = ()

    def cut(self, images: Sequence[NDArray[AnyPixel]]) -> tuple[NDArray[AnyPixel], ...]:
        """The windows of whole images."""
        if not self.windows:
            return tuple(images)
        return tuple(image[window] for image, window in zip(images, self.windows, strict=True))

    def masked(self, masks: Sequence[Mask]) -> "Transmissions":
        """The same, with nothing known of masked pixels; no masks, no change."""
        if not masks:
            return self
        trust = tuple(np.where(mask, np.float32(0), one) for mask, one in zip(masks, self.trust, strict=True))
        return replace(self, trust=trust)

    def noises_of(self, images: Sequence[Image]) -> FloatArray:
        """Standard deviations (K,) of the noise of typical pixels in what is left of the images, or in the images.

        Their level is no noise, however much trust differs from pixel to pixel, as behind a mosaic of colours.
        """
        noises = [_noise_beside_level(image, trust) for image, trust in zip(images, self.trust, strict=True)]
        return np.maximum(noises, LEAST_NOISE)


@dataclass(frozen=True, eq=False)
class ShadowFit:
    """Droplets as they explain the images.

    Parameters
    ----------
    discs : Discs
        The droplets.
    optics : DiscOptics
        How the views see them.
    noises : (K,) array
        Of typical pixels, of the images as they were recorded.
    defects : tuple of (rows, columns) float32 arrays
        What the union of the discs lets through beyond the product of each; empty until it is known.
    liquid : Discs
        Those that explain what is no droplet.
    masks : tuple of (rows, columns) bool arrays
        Pixels that look through it, and have no say; empty where there is none.
    light : SeenLight
        What droplets said of it, with radii in voxels.
    """

    discs: Discs
    optics: DiscOptics
    noises: FloatArray
    defects: tuple[Image, ...] = ()
    liquid: Discs = NO_DISCS
    masks: tuple[Mask, ...] = ()
    light: SeenLight = STATED

    def with_discs(self, discs: Discs) -> "ShadowFit":
        """The same with other droplets."""
        return replace(self, discs=discs)

    def where(self, chosen: NDArray[np.bool_]) -> "ShadowFit":
        """The same with the chosen droplets."""
        return replace(self, discs=self.discs.where(chosen))

    @property
    def amplitude_sigma(self) -> float:
        """Standard deviation of the depth of a faint shadow that stands alone."""
        clearness = self.optics.levels / self.noises
        return float(1 / np.sqrt(np.pi * np.sum(self.optics.variances_px2[:, 0] * clearness**2)))


def _noise_beside_level(image: Image, trust: Image) -> float:
    known = trust > 0
    level = np.median(image[known]) if known.any() else np.float32(0)
    return noise_of((image - level) * np.sqrt(trust), known)


def seen_by(shot: Transmissions, fit: ShadowFit, drawn: Sequence[Image]) -> DiscImages:
    """Images over their levels and less the defects, as the product of discs would have been seen, with their weights.

    Parameters
    ----------
    shot, fit : Transmissions, ShadowFit
        What was recorded, and what is known of it.
    drawn : sequence of (rows, columns) float32 arrays
        Transmissions of the product of the discs.
    """
    images = [image * np.float32(1 / level) for image, level in zip(shot.images, fit.optics.levels, strict=True)]
    if fit.defects:
        images = [image - defect for image, defect in zip(images, fit.defects, strict=True)]
    weights = tuple(
        _weight(trust * np.float32((level / noise) ** 2), model)
        for trust, level, noise, model in zip(
            shot.masked(fit.masks).trust, fit.optics.levels, fit.noises, drawn, strict=True
        )
    )
    return DiscImages(tuple(images), weights, shot.lattice, shot.threads)


def _weight(weight: Image, model: Image) -> Image:
    along_u = cv2.Sobel(model, cv2.CV_32F, 1, 0, ksize=1, scale=0.5)
    along_v = cv2.Sobel(model, cv2.CV_32F, 0, 1, ksize=1, scale=0.5)
    edges = np.float32(CALIBRATION_PX**2) * (along_u**2 + along_v**2)
    return np.asarray(weight / (1 + weight * edges), dtype=np.float32)


def residuals(seen: DiscImages, drawn: Sequence[Image]) -> list[Image]:
    """What the images hold beyond the model."""
    return [image - model for image, model in zip(seen.images, drawn, strict=True)]


def rms_over_noise(seen: DiscImages, drawn: Sequence[Image]) -> float:
    """Root mean square of the residuals over the noise of each pixel."""
    squares = pixels = 0.0
    for left, weight in zip(residuals(seen, drawn), seen.weights, strict=True):
        squares += float(np.vdot(weight, left * left))
        pixels += np.count_nonzero(weight)
    return float(np.sqrt(squares / pixels)) if pixels else 0.0
