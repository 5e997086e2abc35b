"""Images without their blur: a gap between two bodies is dark in an image once it is as narrow as the blur.

The blur is that of the steepest edges of the image itself. What is sought is the darkness that is between none and
all everywhere, and looks like the image once it is blurred (Jansson's constrained iteration, from van Cittert's).
"""

import cv2
import numpy as np

from processing.analysis.droplets.shadows.discs.disc_optics import edge_blur_px, slopes_of
from processing.preprocessing import Intensity

ROUNDS = 10
"""Noise grows with them; twice as many tell simulated shots no better."""
WIDER = 1.2
"""Of the blur of the steepest edges: most lie out of focus a little, and samples between pixels are blurred again."""
REACH_SIGMAS = 3.0
"""So far around what is not known images stay as they are."""


def sharpened(darkness: Intensity, trust: Intensity | None = None) -> Intensity:
    """Darkness, from 0 to 1, without the blur of the image.

    Parameters
    ----------
    darkness : (rows, columns) float32 array
        Share of the light that is missing.
    trust : (rows, columns) float32 array, optional
        0 where nothing is known: nothing is said there, nor as near as the blur reaches.
    """
    slopes = slopes_of(darkness)
    if trust is None or (trust > 0).all():
        return _sharp(darkness, WIDER * edge_blur_px(slopes))
    unknown = (trust <= 0).astype(np.uint8)
    beside = cv2.dilate(unknown, np.ones((3, 3), np.uint8)) > 0
    blur_px = WIDER * edge_blur_px(np.where(beside, 0, slopes))
    reach = 2 * int(np.ceil(REACH_SIGMAS * blur_px)) + 1
    near = cv2.dilate(unknown, np.ones((reach, reach), np.uint8)) > 0
    return np.where(near, darkness, _sharp(darkness, blur_px))


def _sharp(darkness: Intensity, blur_px: float) -> Intensity:
    sharp = darkness
    for _ in range(ROUNDS):
        blurred = cv2.GaussianBlur(sharp, (0, 0), blur_px, borderType=cv2.BORDER_REPLICATE)
        sharp = np.clip(sharp + (darkness - blurred), 0, 1)
    return sharp
