"""Distortions of pictures: of cameras, windows, files, and of who sorted them.

Each takes pictures and an amount between 0 and 1, which it makes an amount of its own, and says it.
"""

from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np
from scipy.ndimage import affine_transform, gaussian_filter

from tests.hunt.bodily import between
from tests.hunt.rig import Array
from tests.hunt.world import DARK, Pictures

Rng = np.random.Generator
Changed = tuple[Pictures, str]


def gamma(seen: Pictures, amount: float, _rng: Rng) -> Changed:
    """Of the camera, so of its references, too."""
    power = between(0.4, 2.5, amount)
    return _each(seen, lambda image: np.clip(image, 0, 1) ** power), f"{power:.2g}"


def black_level(seen: Pictures, amount: float, rng: Rng) -> Changed:
    """The dark image is of another black level."""
    more = between(0.005, 0.15, amount) * rng.choice([-1, 1])
    return replace(seen, darks=np.clip(seen.darks + more, 0, 1)), f"{100 * more:+.2g} % of full scale"


def veil(seen: Pictures, amount: float, _rng: Rng) -> Changed:
    """Even light in the shots alone, which takes nothing from the rest."""
    more = between(0.01, 0.4, amount)
    return replace(
        seen, shots=seen.shots + more * (seen.backgrounds - seen.darks).mean()
    ), f"{100 * more:.2g} % of light"


def brighter(seen: Pictures, amount: float, rng: Rng) -> Changed:
    """All light of the shots against that of the backgrounds."""
    times = between(1.03, 1.5, amount) ** rng.choice([-1, 1])
    return replace(seen, shots=DARK + times * (seen.shots - DARK)), f"x{times:.2g}"


def uneven(seen: Pictures, amount: float, rng: Rng) -> Changed:
    """The light of the shots falls off to another side than that of the backgrounds."""
    fall, turn = between(0.01, 0.5, amount), rng.uniform(0, 2 * np.pi)
    row, column = _field(seen)
    light = 1 + fall * (np.cos(turn) * column + np.sin(turn) * row)
    return replace(seen, shots=DARK + (seen.shots - DARK) * light), f"{100 * fall:.2g} %"


def glow(seen: Pictures, amount: float, rng: Rng) -> Changed:
    """A smooth bright cloud in all shots of one view."""
    more, view = between(0.01, 0.5, amount), _one_view(seen, rng)
    row, column = _field(seen)
    middle = rng.uniform(-0.5, 0.5, 2)
    shots = seen.shots.copy()
    shots[:, :, view] += more * np.exp(-((row - middle[0]) ** 2 + (column - middle[1]) ** 2) / 0.2)
    return replace(seen, shots=shots), f"{100 * more:.2g} % of full scale"


def dusty(seen: Pictures, amount: float, rng: Rng) -> Changed:
    """Specks on the window of one view that its background does not show."""
    count, view = round(between(2, 80, amount)), _one_view(seen, rng)
    return replace(seen, shots=_times(seen.shots, view, _specks(seen, count, rng))), f"{count}"


def dusty_background(seen: Pictures, amount: float, rng: Rng) -> Changed:
    """Specks that were there with the background, and are gone."""
    count, view = round(between(2, 80, amount)), _one_view(seen, rng)
    backgrounds = seen.backgrounds.copy()
    backgrounds[view] = DARK + (backgrounds[view] - DARK) * _specks(seen, count, rng)
    return replace(seen, backgrounds=backgrounds), f"{count}"


def hot_pixels(seen: Pictures, amount: float, rng: Rng) -> Changed:
    """In all views, bright in the shots alone."""
    count = round(between(3, 3000, amount))
    shots = seen.shots.copy()
    for view in range(shots.shape[2]):
        rows, columns = rng.integers(0, shots.shape[3], count), rng.integers(0, shots.shape[4], count)
        shots[:, :, view, rows, columns] = rng.uniform(0.7, 1, count)
    return replace(seen, shots=shots), f"{count}"


def saturated(seen: Pictures, amount: float, _rng: Rng) -> Changed:
    """So much of the light is cut off, of backgrounds, too."""
    most = 1 - between(0.02, 0.4, amount)
    limit = DARK + most * (seen.backgrounds.max() - DARK)
    return replace(
        seen, shots=np.minimum(seen.shots, limit), backgrounds=np.minimum(seen.backgrounds, limit)
    ), f"above {100 * most:.3g} %"


def shots_saturated(seen: Pictures, amount: float, _rng: Rng) -> Changed:
    """Grey values end where the shots are bright, and at the full scale."""
    times = between(1.1, 3, amount)
    shots, backgrounds = (np.clip(DARK + times * (images - DARK), 0, 1) for images in (seen.shots, seen.backgrounds))
    return replace(seen, shots=shots, backgrounds=backgrounds), f"x{times:.2g}"


def exposed_twice(seen: Pictures, amount: float, _rng: Rng) -> Changed:
    """Both flashes in exposure A, B as it should be; the second gives a share of the light."""
    share = between(0.03, 0.5, amount)
    if seen.shots.shape[1] < 2:
        return seen, "nothing"
    shots = seen.shots.copy()
    shots[:, 0] = (1 - share) * shots[:, 0] + share * seen.shots[:, 1]
    return replace(seen, shots=shots), f"{100 * share:.2g} %"


def both_exposed_twice(seen: Pictures, amount: float, _rng: Rng) -> Changed:
    """Both flashes in both exposures."""
    share = between(0.03, 0.5, amount)
    if seen.shots.shape[1] < 2:
        return seen, "nothing"
    return replace(seen, shots=(1 - share) * seen.shots + share * seen.shots[:, ::-1]), f"{100 * share:.2g} %"


def dead_view(seen: Pictures, _amount: float, rng: Rng) -> Changed:
    """One view shows its background alone."""
    view, shots = _one_view(seen, rng), seen.shots.copy()
    noise = np.std(seen.shots[0, 0, view] - gaussian_filter(seen.shots[0, 0, view], 2))
    shots[:, :, view] = seen.backgrounds[view] + noise * rng.standard_normal(shots[:, :, view].shape)
    return replace(seen, shots=shots), f"view {view + 1}"


def frozen_view(seen: Pictures, _amount: float, rng: Rng) -> Changed:
    """One view shows in B what it did in A, or in all shots what it did in the first."""
    view, shots = _one_view(seen, rng), seen.shots.copy()
    shots[:, :, view] = shots[0, 0, view]
    return replace(seen, shots=shots), f"view {view + 1}"


def half_hidden(seen: Pictures, amount: float, rng: Rng) -> Changed:
    """A dark band in one view that its background does not show."""
    view, shots = _one_view(seen, rng), seen.shots.copy()
    wide = round(between(0.03, 0.6, amount) * shots.shape[4])
    left = int(rng.integers(0, shots.shape[4] - wide))
    shots[:, :, view, :, left : left + wide] = DARK
    return replace(seen, shots=shots), f"{wide} columns"


def half_empty(seen: Pictures, amount: float, rng: Rng) -> Changed:
    """A band of one view shows its background alone: droplets vanish there."""
    view, shots = _one_view(seen, rng), seen.shots.copy()
    wide = round(between(0.03, 0.8, amount) * shots.shape[4])
    left = int(rng.integers(0, shots.shape[4] - wide))
    band = np.s_[:, :, view, :, left : left + wide]
    shots[band] = seen.backgrounds[view, :, left : left + wide] + 0.005 * rng.standard_normal(shots[band].shape)
    return replace(seen, shots=shots), f"{wide} columns"


def ghosted(seen: Pictures, amount: float, rng: Rng) -> Changed:
    """One view shows itself again beside itself, as behind two panes."""
    share, view = between(0.02, 0.5, amount), _one_view(seen, rng)
    far = rng.integers(-20, 21, 2)
    shots = seen.shots.copy()
    shots[:, :, view] = (1 - share) * shots[:, :, view] + share * np.roll(shots[:, :, view], tuple(far), (-2, -1))
    return replace(seen, shots=shots), f"{100 * share:.2g} %"


def resampled(seen: Pictures, amount: float, rng: Rng) -> Changed:
    """All images were made smaller and larger again, by linear interpolation."""
    times = between(1.05, 2.5, amount)
    return _each(seen, lambda image: _smaller_and_larger(image, times)), f"by {times:.2g}"


def shots_resampled(seen: Pictures, amount: float, rng: Rng) -> Changed:
    """Shots, not references, were moved by parts of a pixel, by linear interpolation."""
    far = between(0.1, 0.5, amount)
    shots = affine_transform(seen.shots, np.ones(5), (0, 0, 0, far, far), order=1, mode="nearest")
    return replace(seen, shots=shots), f"{far:.2g} px"


def compressed(seen: Pictures, amount: float, _rng: Rng) -> Changed:
    """All images have been through JPEG."""
    quality = round(between(98, 15, amount))
    return _each(seen, lambda image: _through_jpeg(image, quality)), f"quality {quality}"


def rows_shaken(seen: Pictures, amount: float, rng: Rng) -> Changed:
    """Rows of one view lie beside where they should, as by a shutter that rolls while it shakes."""
    view, far = _one_view(seen, rng), between(0.2, 5, amount)
    turns, shots = rng.uniform(0.5, 4), seen.shots.copy()
    columns = np.arange(shots.shape[4])
    for row in range(shots.shape[3]):
        at = columns + far * np.sin(2 * np.pi * turns * row / shots.shape[3])
        for shot, exposure in np.ndindex(shots.shape[:2]):
            shots[shot, exposure, view, row] = np.interp(at, columns, seen.shots[shot, exposure, view, row])
    return replace(seen, shots=shots), f"{far:.2g} px"


def denoised(seen: Pictures, amount: float, _rng: Rng) -> Changed:
    """Shots, not references, were smoothed by a median."""
    width = 3 if amount < 0.5 else 5
    shots = _all(seen.shots, lambda image: np.asarray(cv2.medianBlur(image.astype(np.float32), width), float))
    return replace(seen, shots=shots), f"{width} px"


def sharpened(seen: Pictures, amount: float, _rng: Rng) -> Changed:
    """By an unsharp mask, as cameras do; references, too."""
    gain = between(0.1, 1.5, amount)
    return _each(seen, lambda image: image + gain * (image - gaussian_filter(image, 1.0))), f"{gain:.2g}"


def banded(seen: Pictures, amount: float, rng: Rng) -> Changed:
    """Each row has a level of its own, as by a readout that hums."""
    more = between(0.002, 0.05, amount)
    levels = more * rng.standard_normal((*seen.shots.shape[:4], 1))
    return replace(seen, shots=seen.shots + levels), f"{100 * more:.2g} %"


def coarse(seen: Pictures, amount: float, _rng: Rng) -> Changed:
    """Few grey values, in shots and references."""
    steps = round(between(100, 8, amount))
    return _each(seen, lambda image: np.rint(image * steps) / steps), f"{steps} values"


def b_is_another(seen: Pictures, _amount: float, _rng: Rng) -> Changed:
    """B shows the droplets mirrored, which none of A are."""
    if seen.shots.shape[1] < 2:
        return seen, "nothing"
    shots = seen.shots.copy()
    shots[:, 1] = shots[:, 1, :, ::-1]
    return replace(seen, shots=shots), "all views"


def b_is_a(seen: Pictures, _amount: float, _rng: Rng) -> Changed:
    shots = seen.shots.copy()
    shots[:, -1] = shots[:, 0]
    return replace(seen, shots=shots), "all views" if seen.shots.shape[1] > 1 else "nothing"


def b_is_a_with_noise(seen: Pictures, _amount: float, rng: Rng) -> Changed:
    """Both exposures in one flash."""
    shots = seen.shots.copy()
    shots[:, -1] = shots[:, 0] + 0.004 * rng.standard_normal(shots[:, 0].shape)
    return replace(seen, shots=shots), "all views" if seen.shots.shape[1] > 1 else "nothing"


def exchanged(seen: Pictures, _amount: float, _rng: Rng) -> Changed:
    return replace(seen, shots=seen.shots[:, ::-1]), "A and B" if seen.shots.shape[1] > 1 else "nothing"


def exchanged_in_one(seen: Pictures, _amount: float, rng: Rng) -> Changed:
    """A and B of one view."""
    view, shots = _one_view(seen, rng), seen.shots.copy()
    shots[:, :, view] = shots[:, ::-1, view]
    return replace(seen, shots=shots), f"view {view + 1}" if seen.shots.shape[1] > 1 else "nothing"


def lost_frame(seen: Pictures, _amount: float, rng: Rng) -> Changed:
    """A frame of one view did not arrive."""
    lost = tuple(int(rng.integers(side)) for side in seen.shots.shape[:3])
    return replace(seen, missing=frozenset({(lost[0], lost[1], lost[2])})), f"{lost}"


def dimmer_b(seen: Pictures, amount: float, _rng: Rng) -> Changed:
    """The second flash is weaker, and its background is that of the first."""
    if seen.shots.shape[1] < 2:
        return seen, "nothing"
    share, shots = between(0.98, 0.4, amount), seen.shots.copy()
    shots[:, 1] = DARK + share * (shots[:, 1] - DARK)
    return replace(seen, shots=shots), f"x{share:.2g}"


def longer_b(seen: Pictures, amount: float, _rng: Rng) -> Changed:
    """B is read out longer, and lets in even light."""
    if seen.shots.shape[1] < 2:
        return seen, "nothing"
    more, shots = between(0.01, 0.3, amount), seen.shots.copy()
    shots[:, 1] += more * (seen.backgrounds - DARK).mean()
    return replace(seen, shots=shots), f"{100 * more:.2g} %"


def cropped(seen: Pictures, amount: float, _rng: Rng) -> Changed:
    """Rows of all images are from farther down than those of the calibration."""
    far = round(between(1, 20, amount))
    shots, backgrounds = (np.roll(images, -far, axis=-2) for images in (seen.shots, seen.backgrounds))
    return replace(seen, shots=shots, backgrounds=backgrounds), f"{far} rows"


def mirrored(seen: Pictures, _amount: float, _rng: Rng) -> Changed:
    """All images of all views, left to right."""
    return replace(seen, shots=seen.shots[..., ::-1], backgrounds=seen.backgrounds[..., ::-1]), "all views"


def background_of_spray(seen: Pictures, amount: float, _rng: Rng) -> Changed:
    """The background has a share of the first shot."""
    share = between(0.03, 0.5, amount)
    return replace(seen, backgrounds=(1 - share) * seen.backgrounds + share * seen.shots[0, 0]), f"{100 * share:.2g} %"


def _one_view(seen: Pictures, rng: Rng) -> int:
    return int(rng.integers(seen.shots.shape[2]))


def _field(seen: Pictures) -> tuple[Array, Array]:
    rows, columns = seen.shots.shape[3:]
    row, column = np.mgrid[-1 : 1 : rows * 1j, -1 : 1 : columns * 1j]
    return row, column


def _specks(seen: Pictures, count: int, rng: Rng) -> Array:
    """What specks let through, out of focus."""
    rows, columns = seen.shots.shape[3:]
    light = np.zeros((rows, columns))
    light[rng.integers(0, rows, count), rng.integers(0, columns, count)] = rng.uniform(5, 30, count)
    return np.asarray(1 - np.clip(gaussian_filter(light, rng.uniform(1, 3)), 0, 0.9))


def _times(shots: Array, view: int, share: Array) -> Array:
    out = shots.copy()
    out[:, :, view] = DARK + (out[:, :, view] - DARK) * share
    return out


def _all(images: Array, change: Callable[[Array], Array]) -> Array:
    flat = images.reshape(-1, *images.shape[-2:])
    return np.stack([change(image) for image in flat]).reshape(images.shape)


def _each(seen: Pictures, change: Callable[[Array], Array]) -> Pictures:
    shots, backgrounds, darks = (_all(images, change) for images in (seen.shots, seen.backgrounds, seen.darks))
    return replace(seen, shots=shots, backgrounds=backgrounds, darks=darks)


def _smaller_and_larger(image: Array, times: float) -> Array:
    rows, columns = image.shape
    small = cv2.resize(image, (round(columns / times), round(rows / times)), interpolation=cv2.INTER_LINEAR)
    return np.asarray(cv2.resize(small, (columns, rows), interpolation=cv2.INTER_LINEAR), float)


def _through_jpeg(image: Array, quality: int) -> Array:
    grey = np.clip(np.rint(255 * image), 0, 255).astype(np.uint8)
    _, coded = cv2.imencode(".jpg", grey, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return np.asarray(cv2.imdecode(coded, cv2.IMREAD_GRAYSCALE), float) / 255
