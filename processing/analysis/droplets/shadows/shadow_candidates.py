"""Where droplets may be that cast a shadow which is not explained yet."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from processing.analysis.droplets.candidates import candidates
from processing.analysis.droplets.droplet_search import Window
from processing.analysis.droplets.gaussian_blobs import Image
from processing.analysis.droplets.shadows.discs.opaque_discs import DiscImages
from processing.geometry import FloatArray
from processing.reconstruction.planning.plan import Plan

SEEN_FROM_ASIDE = 0.6
"""What is left of a shadow at the nearest candidate of the coarser grid."""
BLACK, DARK = 0.12, 0.5
"""Transmissions of the model up to which a view has no say: all views at once, or one of them."""
SMOOTHING_REACH_SIGMAS = 4.0


@dataclass(frozen=True)
class Stage:
    """How candidates are looked for in a round.

    Parameters
    ----------
    smooth_px : float
        Blur of what is missing.
    threshold : float
        Least share of the light that all views miss.
    coarse : bool
        Whether candidates enter with a size of their own, or as good as without.
    joker : bool
        Whether a view that sees little, or knows nothing, may be without a say, one for each candidate; else all that
        see black.
    hidden : bool
        Whether such candidates are looked for in this round: that takes longer.
    masked : bool
        Whether pixels of which nothing is known agree with any candidate, in all views.
    """

    smooth_px: float
    threshold: float
    coarse: bool = False
    joker: bool = False
    hidden: bool = False
    masked: bool = False


def shadow_peaks(
    plan: Plan, seen: DiscImages, drawn: Sequence[Image], stage: Stage, windows: Sequence[Window] = ()
) -> FloatArray:
    """Peaks (N, 4): x, y, z in voxels of the plan, and the share of the light that all views miss there.

    Parameters
    ----------
    plan : Plan
        Geometry of views and grid.
    seen : DiscImages
        The images.
    drawn : sequence of (rows, columns) float32 arrays
        Transmissions of the droplets that are known.
    stage : Stage
        What to look for.
    windows : sequence of (rows, columns) slices
        As of ``candidates``.
    """
    gains = np.ones(len(drawn))
    return np.concatenate(
        [
            candidates(plan, views, gains, SEEN_FROM_ASIDE * stage.threshold, seen.threads, windows)
            for views in _missing(seen, drawn, stage)
        ]
    )


def _missing(seen: DiscImages, drawn: Sequence[Image], stage: Stage) -> Iterator[list[Image]]:
    """Missing shares of the light; once for all, and with a joker once more for every view that has no say."""
    most = DARK if stage.joker else BLACK
    shares, unseen = [], []
    for image, weight, model in zip(seen.images, seen.weights, drawn, strict=True):
        share = (model - image) / np.maximum(model, np.float32(most))
        black, known = model <= most, weight > 0
        unseen.append(black | ~known)
        share = np.where(black, np.float32(0 if stage.joker else 1), share)
        shares.append(np.where(known, share, np.float32(stage.masked)))
    smoothed = [_smoothed(share, stage.smooth_px) for share in shares]
    yield smoothed
    for view in range(len(drawn)) if stage.hidden else ():
        yield [unseen[view].astype(np.float32) if view == number else one for number, one in enumerate(smoothed)]


def _smoothed(image: Image, sigma_px: float) -> Image:
    width = 2 * int(np.ceil(SMOOTHING_REACH_SIGMAS * sigma_px)) + 1
    return np.asarray(cv2.GaussianBlur(image, (width, width), sigma_px, borderType=cv2.BORDER_REFLECT))
