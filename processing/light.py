"""Does the light of an exposure fit its background and its polarity? What does not makes volumes that look fine."""

from collections.abc import Mapping

import cv2
import numpy as np
from numpy.typing import NDArray

from processing.exchanged_light import better_background
from processing.imprint import imprint
from processing.interlaced import ALTERNATING, rows_alternate
from processing.preprocessing import Frame, Intensity, Polarity, is_dim, known_light

DIM_LIGHT = "uses less than 1/8 of its grey values; is light missing, or are its bits too many?"
FULL = 0.998
"""Of the full scale: nobody knows how much more light it was."""
STRIDE_PX = 4
"""Every so many rows and columns are asked: light varies slowly."""
GAIN = 1.25
"""A pixel with that many times the light of its background is brighter than it, beyond flicker."""
NOISE = 0.05
"""Of the full scale: smaller differences are noise, darker backgrounds no light."""
BRIGHTER_SHARE = 0.003
"""So many pixels are brighter, or darker than nothing: more than glare and hot pixels."""
LEAST_LIGHT = 0.8
"""Of the background, somewhere: hardly a spray covers all of a view."""
BRIGHTEST = 0.02
"""So many pixels are somewhere."""
SATURATED_SHARE = 0.01
"""So many pixels of an image at full scale: more light than the camera can tell."""
LEAST_FULL, PILED, BELOW = 0.8, 2, 8
"""Many cameras are full below their full scale: at so much of it or above, the highest grey value has more than a
hundredth of the pixels, and that many times those of each of the next eight. Light has noise, and its highest value a
few; where it has none, it varies."""
LEAST_KNOWN = 0.1
"""Share of the pixels of a view of which something must be known."""
MOST_SCATTERED, PATCH_PX = 0.05, 5
"""Share of the pixels of which nothing is known while their neighbours are: of squares that wide some pixel is. With 4
and 7 % of them droplets are found; with 10 % none is, and the view looked empty."""
OPAQUE = 0.6
"""From so much missing light on a shadow is dense; of bright particles, so much of the height of the brightest."""
FEW = 10
"""Pixels tell nothing."""
MOST_HOLLOW = 0.25
"""Share of them that may be missing in intensities: noise floor and edges take a tenth."""
DARKEST = 0.5
"""Of the background: what is darker is a shadow, not the light of the exposure."""
ASKED = 8000
"""Pixels tell how much light there is to a thousandth."""
ALIKE = 0.05
"""Pixels whose share differs by that much have the same light, but for noise."""
SHADOWS_ABOVE = 0.6
"""Of the span of grey values: if half of the pixels are above, dark spots lie on bright ground."""


def odd_light(
    frame: Frame,
    polarity: Polarity,
    *,
    bits: int,
    dark: Intensity | None = None,
    background: Intensity | None = None,
    others: Mapping[str, Intensity] | None = None,
) -> str:
    """What is odd with the light of an exposure; empty where nothing is.

    Parameters
    ----------
    frame : (rows, columns) uint8 or uint16 array
        Grey values.
    polarity : {"shadow", "bright"}
        What the run states.
    bits : int
        Significant bits of a grey value.
    dark, background : (rows, columns) float32 array, optional
        As for ``processing.preprocessing.intensity``.
    others : mapping of name to (rows, columns) float32 array, optional
        Backgrounds of other views, which may be exchanged.
    """
    if rows_alternate(frame):
        return ALTERNATING
    coarse, most = np.s_[::STRIDE_PX, ::STRIDE_PX], np.float32(2**bits - 1)
    light = _above_dark(frame, dark) / most
    if np.mean(light < -NOISE) > BRIGHTER_SHARE:
        return "is darker than its dark image; was that taken with light, or with another exposure?"
    if polarity == "bright":
        return _not_bright(light) or _saturated(frame[coarse], most)
    if black := _black_lines(frame):
        return black
    if background is None:
        return _saturated(frame[coarse], most)
    if wrong := odd_background(frame, background, dark, others):
        return wrong
    if (share := np.mean(background[coarse] > FULL * most)) > SATURATED_SHARE:
        return f"has a background of which {100 * share:.0f} % are saturated: shadows are too pale there"
    return (
        _unlike((light, _above_dark(background, dark) / most))
        or _unknown(background, dark, bits)
        or _saturated(frame[coarse], most)
    )


def dim_light(frame: Frame, bits: int) -> str:
    """What it says where no grey value of that many significant bits is bright; empty where one is."""
    return DIM_LIGHT if frame.size and is_dim(frame, bits) else ""


def odd_background(
    frame: Frame,
    background: Intensity,
    dark: Intensity | None = None,
    others: Mapping[str, Intensity] | None = None,
) -> str:
    """What it says where a background shows the shadows of its exposure, or is another's; empty where it is fine.

    Parameters
    ----------
    frame, background, dark, others
        As for ``odd_light``.
    """
    coarse = np.s_[::STRIDE_PX, ::STRIDE_PX]
    if np.ptp(frame[coarse]) and np.array_equal(frame[coarse], background[coarse]):
        return "is its own background, pixel by pixel: whatever there was is divided out"
    if share := imprint(frame, background, dark):
        return (
            f"has {100 * share:.0f} % of its own shadows in its background, so they are too pale and too small: is the "
            "shot one of its backgrounds, or are these the mean of a series with spray?"
        )
    if better := better_background(frame, background, dark, others):
        return f"does not fit its background, but {better}: is that exchanged, or turned?"
    return ""


def unknown_light(known: NDArray[np.bool_]) -> str:
    """What a view says of whose pixels too few are known, or too many are unknown here and there; else empty.

    Unknown pixels that lie together are dark corners, or what is ignored.

    Parameters
    ----------
    known : (rows, columns) array
        As of ``processing.preprocessing.known_light``.
    """
    if (share := float(np.mean(known))) < LEAST_KNOWN:
        return f"has {100 * share:.0f} % of its pixels that are known: is its background saturated, or dark?"
    unknown = ~known
    patch = np.ones((PATCH_PX, PATCH_PX), np.uint8)
    together = cv2.morphologyEx(unknown.astype(np.uint8), cv2.MORPH_OPEN, patch) > 0
    if (scattered := float(np.mean(unknown & ~together))) <= MOST_SCATTERED:
        return ""
    return (
        f"has {100 * scattered:.0f} % of its pixels, here and there, of which nothing is known, limit "
        f"{100 * MOST_SCATTERED:.0f} %: is its background near saturation, or dark? No droplet is found among them"
    )


def light_share(frame: Frame, background: Intensity, *, bits: int, dark: Intensity | None = None) -> float:
    """Which share of the light of its background an exposure of shadows has, where nothing is in the way.

    That is the share that most pixels have. With less light all shadows are as much paler.

    Parameters
    ----------
    frame, background, bits, dark
        As for ``odd_light``.

    Returns
    -------
    float
        NaN where pixels are too few to tell.
    """
    most = np.float32(2**bits - 1)
    return _share(_above_dark(frame, dark) / most, _above_dark(background, dark) / most)


def hollowed(
    frame: Frame,
    image: Intensity,
    polarity: Polarity,
    *,
    bits: int,
    dark: Intensity | None = None,
    background: Intensity | None = None,
) -> str:
    """Whether structures are wider than the window of the sliding minimum, which takes away their middle.

    Parameters
    ----------
    frame, polarity, bits, dark, background
        As for ``odd_light``.
    image : (rows, columns) float32 array
        Its intensities.

    Returns
    -------
    str
        What is lost; empty where little is, or where shadows have no background to tell by.
    """
    coarse, most = np.s_[::STRIDE_PX, ::STRIDE_PX], np.float32(2**bits - 1)
    light = _above_dark(frame, dark) / most
    if polarity == "bright":
        seen = light - np.median(light)
        dense = seen > OPAQUE * np.percentile(seen, 99.9)
    elif background is not None:
        full = _above_dark(background, dark) / most
        whole = np.fmin(_share(light, full), 1.0)  # what dim light takes away everywhere is no structure
        seen = np.where(full > NOISE, whole - light / np.maximum(full, NOISE), np.float32(0))
        dense = seen > OPAQUE * whole
    else:
        return ""
    return _lost(seen[dense], image[coarse][dense])


def _above_dark(image: Frame | Intensity, dark: Intensity | None) -> NDArray[np.float32]:
    """Grey values of the pixels that are asked, above those of the dark image."""
    coarse = np.s_[::STRIDE_PX, ::STRIDE_PX]
    return np.asarray(image[coarse] - (np.float32(0) if dark is None else dark[coarse]), np.float32)


def _share(light: NDArray[np.float32], full: NDArray[np.float32]) -> float:
    """Which share of the full light most pixels have, of some thousand; NaN of too few."""
    some = np.s_[:: max(1, light.size // ASKED)]
    light, full = light.ravel()[some], full.ravel()[some]
    shares = light[full > NOISE] / full[full > NOISE]
    shares = shares[(shares > DARKEST) & (shares < 2 - DARKEST)]
    if shares.size < FEW:
        return float("nan")
    commonest = np.argmax(np.bincount(np.rint(100 * shares).astype(np.intp))) / 100
    return float(np.median(shares[np.abs(shares - commonest) < ALIKE]))


def _lost(seen: NDArray[np.float32], kept: Intensity) -> str:
    if seen.size < FEW or (lost := 1 - float(kept.sum() / seen.sum())) <= MOST_HOLLOW:
        return ""
    return (
        f"loses {100 * lost:.0f} % of what is dense to the sliding minimum, which is narrower than that: volumes are "
        "hollow there; take a wider one (minimum_window_px), or none (0)"
    )


def _saturated(frame: Frame, most: np.float32) -> str:
    if (share := _full_share(frame, most)) <= SATURATED_SHARE:
        return ""
    return f"is saturated in {100 * share:.0f} % of its pixels: what there is is unknown"


def _full_share(frame: Frame, most: np.float32) -> float:
    """Share of the pixels at full scale, or of those that pile up at the highest grey value below it."""
    full, highest = float(np.mean(frame > FULL * most)), int(frame.max(initial=0))
    if full > SATURATED_SHARE or highest < LEAST_FULL * most:
        return full
    return float(np.mean(frame == highest)) if piles_up(frame) else full


def piles_up(frame: Frame) -> bool:
    """Whether a camera is full at the highest grey value of a frame: light has noise, and its highest value a few."""
    highest = int(frame.max(initial=0))
    brightest = frame[frame >= highest - BELOW].astype(np.int64) - (highest - BELOW)
    counts = np.bincount(brightest, minlength=BELOW + 1)
    return bool(counts[-1] > PILED * counts[:-1].max())


def _unknown(background: Intensity, dark: Intensity | None, bits: int) -> str:
    """As ``unknown_light``; most backgrounds are known nearly everywhere, as a few pixels tell in no time."""
    level, coarse = np.float32(0) if dark is None else dark, np.s_[::STRIDE_PX, ::STRIDE_PX]
    known = known_light(background[coarse], level if dark is None else dark[coarse], bits=bits)
    return unknown_light(known_light(background, level, bits=bits)) if np.mean(known) < 1 - MOST_SCATTERED else ""


def _black_lines(frame: Frame) -> str:
    """Whole rows or columns of shadows without a single count: no droplet is as long and as straight."""
    for lines, axis in (("rows", 1), ("columns", 0)) if frame.any() else ():
        if count := int(np.count_nonzero(~frame.any(axis=axis))):
            return f"has {count} {lines} without a single count: is a part of the image missing?"
    return ""


def _not_bright(light: NDArray[np.float32]) -> str:
    least, most = np.percentile(light, (0.1, 99.9))
    if most - least > 2 * NOISE and (np.median(light) - least) / (most - least) > SHADOWS_ABOVE:
        return 'shows dark spots on bright ground, and the run states polarity "bright"; is it "shadow"?'
    return ""


def _unlike(lights: tuple[NDArray[np.float32], NDArray[np.float32]]) -> str:
    """Compare an exposure with its background where that has light."""
    light, full = (one[lights[1] > NOISE] for one in lights)
    if not full.size:
        return "has a background without light; are background and dark exchanged?"
    share = light / full
    if np.mean(light > GAIN * full + NOISE) > BRIGHTER_SHARE or np.mean(share > GAIN) > 1 / 2:
        return (
            "is brighter than its background; is there spray in the background, was it taken with less light, "
            'or are these bright particles (polarity = "bright")?'
        )
    if np.mean(share >= LEAST_LIGHT) < BRIGHTEST:  # to count is much faster than to sort
        most = 100 * np.percentile(share, 100 * (1 - BRIGHTEST))
        return f"has at most {most:.0f} % of the light of its background; was that taken with more light?"
    return ""
