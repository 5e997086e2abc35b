"""Whether a reticle stood still between two exposures: the mean of moved images makes dots smaller."""

import cv2
import numpy as np
from numpy.typing import NDArray

from processing.analysis.droplets.gaussian_blobs import Image
from processing.analysis.reticle.size_groups import ReticleError
from processing.geometry import FloatArray

MOST_PX = 0.5
"""Dots of images that lie a pixel apart are 1 to 2 um too small, 2 px apart 5 um."""


def shift_px(first: Image, image: Image, known: NDArray[np.bool_]) -> FloatArray:
    """How far an exposure lies beside the first one, rows and columns (2,): what explains their difference best.

    By the slopes of the first: right where it is less than the blur; of larger ones it comes to about 1.8 blurs.
    """
    inner = cv2.erode(known.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    slopes = np.stack([np.gradient(first, axis=axis)[inner] for axis in (0, 1)], axis=1).astype(np.float64)
    found = np.linalg.lstsq(slopes, (first - image)[inner].astype(np.float64), rcond=None)[0]
    return np.asarray(found, dtype=np.float64)


def require_still(first: Image, image: Image, known: NDArray[np.bool_], where: str) -> None:
    """Refuse an exposure that lies beside the first one.

    Parameters
    ----------
    first, image : (rows, columns) float32 arrays
        Light over that of the background.
    known : (rows, columns) bool array
        Where both are known.
    where : str
        Shot and view.

    Raises
    ------
    ReticleError
        It lies more than ``MOST_PX`` beside it.
    """
    if (beside_px := float(np.linalg.norm(shift_px(first, image, known)))) > MOST_PX:
        raise ReticleError(
            f"{where}: its image lies about {beside_px:.1f} px or more beside that of the first exposure, limit "
            f"{MOST_PX:g} px: the reticle moved; choose shots while it stood still (--shots)"
        )
