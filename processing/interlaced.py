"""Are odd and even rows of an image of different times, as fields of video are? Then droplets are there twice, thinned.

Rows that alternate where droplets are have a share of the finest pattern that no lens makes: the one next to it is
weaker, too, only where there is nothing but noise.
"""

import numpy as np
from numpy.typing import NDArray

ALTERNATING = (
    "has rows that alternate: are these two fields of video, of different times? Import one of them as an image"
)
WINDOW_PX = 16
"""Rows of which patterns are compared."""
STEP_PX = 8
"""Every so many columns are asked."""
MOST_ALTERNATING = 2.3
"""Power of rows that alternate over that of the next coarser pattern. Of noise it is 1, of images of others less than
1.1; woven from two times, those have 1.1 to 46."""
ROUNDED = 8.0
"""Added to that of the coarser pattern: whole grey values are rounded."""
SLIGHT = 1e-3
"""Of the light in a window: what alternates by less alternates by rounding."""

_ROWS = np.arange(WINDOW_PX)
_FADE = np.sin(np.pi * (_ROWS + 0.5) / WINDOW_PX) ** 2
"""Towards the ends of the window, or a single sharp edge would look alternating."""
_COARSER = 0.75 * np.pi * _ROWS
_PATTERNS = (_FADE * [np.cos(np.pi * _ROWS), np.cos(_COARSER), np.sin(_COARSER), np.ones(WINDOW_PX)]).astype(np.float32)


def rows_alternate(frame: NDArray[np.generic]) -> bool:
    """Whether rows alternate where droplets are; a camera whose rows differ everywhere alike does no harm."""
    windows = frame.shape[0] // WINDOW_PX
    if not windows:
        return False
    rows = frame[: windows * WINDOW_PX, ::STEP_PX].astype(np.float32).reshape(windows, WINDOW_PX, -1)
    finest, cosine, sine, light = (_PATTERNS @ rows).transpose(1, 0, 2)
    everywhere = np.sum(finest * light) / max(float(np.sum(light**2)), 1e-9)
    finest = finest - everywhere * light
    quiet = (SLIGHT * float(np.median(light[:, ::4]))) ** 2 + ROUNDED * np.issubdtype(frame.dtype, np.integer)
    return bool(np.mean(finest**2) > MOST_ALTERNATING * (np.mean(cosine**2 + sine**2) + quiet))
