"""Images that told discs do not explain: droplets too faint to be told, and edges that no blurred disc has.

Each case was *good*, with the error that is named beside it; images are drawn without any code of the product.
"""

from collections.abc import Callable

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from processing.analysis.flat.flat_doubts import flat_doubts
from processing.analysis.flat.flat_droplets import FlatDroplets, measure_flat
from processing.analysis.flat.flat_settings import FlatSettings
from tests.support.flat_scenes import (
    LIGHT,
    PLACES,
    SHAPE,
    SMALL,
    noisy,
    out_of_focus,
    seen,
    shadow,
    spread_discs,
)

Image = NDArray[np.floating]


def doubts(image: Image, bright: bool = False) -> tuple[str, FlatDroplets]:
    found = measure_flat(image, FlatSettings(polarity="bright") if bright else None)
    return " | ".join(flat_doubts(found)), found


def test_dim_small_particles_are_counted_and_means_doubted() -> None:
    """A third was 15 % as bright as the others, and in no number; D10 was 18 % too large."""
    large = np.setdiff1d(np.arange(len(PLACES)), SMALL)
    light = 2 - seen(spread_discs(some=large)) * seen(spread_discs(some=SMALL), depth=0.15)
    said, found = doubts(noisy(light - 0.95), bright=True)
    assert len(found) == len(large)
    assert found.left_out.get("faint", 0) == len(SMALL)
    assert "too faint to be sized, and mostly small ones" in said


@pytest.mark.parametrize("size_px", [1.0, 1.5])
def test_specks_beside_large_droplets_are_counted(size_px: float) -> None:
    """Ten times as many as were told: D10 was six times too large."""
    specks = [(x + 17, y + 18, size_px) for x, y in PLACES[:17]]
    said, found = doubts(noisy(seen([*spread_discs(some=slice(3)), *specks])))
    assert len(found) == 3
    assert found.left_out.get("faint", 0) >= 15
    assert "3 of 2" in said
    assert "shadows are measured" in said


def test_pale_small_shadows_are_counted_and_means_doubted() -> None:
    large = np.setdiff1d(np.arange(len(PLACES)), SMALL)
    said, found = doubts(
        noisy(seen(spread_discs(some=large)) * seen(spread_discs(some=SMALL), depth=0.14), noise=0.015)
    )
    assert found.left_out.get("faint", 0) == len(SMALL)
    assert "too faint to be sized" in said


def rings(inner: float) -> Image:
    return np.asarray(1 - (shadow(spread_discs(inner), 0.8) - shadow(spread_discs(), 0.8)) / LIGHT, np.float64)


def steps(levels: int) -> Image:
    light = noisy(seen(spread_discs(), blur_px=1.0), 0.005) / 170
    return np.asarray(np.clip(np.round(light * (levels - 1)), 0, levels - 1) / (levels - 1) * 170, np.float32)


def doublets() -> Image:
    """Three quarters of the droplets have a smaller one at their edge; D10 was 20 to 40 % too large."""
    beside = [(x + 0.55 * size, y + 0.2 * size, 0.55 * size) for x, y, size in spread_discs(some=slice(18))]
    return noisy(seen([*spread_discs(), *beside]))


def thresholded() -> Image:
    """A threshold at 0.7 of the light behind a blur of 2 px, then noise of 10 grey values: 11 % too large."""
    return noisy(np.where(seen(spread_discs(), blur_px=2.0) > 0.7, 0.85, 0.2), 0.06)


@pytest.mark.parametrize(
    "image",
    [
        pytest.param(lambda: noisy(rings(0.85)), id="rings of 0.85: 14 to 16 %"),
        pytest.param(lambda: noisy(rings(0.7)), id="rings of 0.7: 6 %"),
        pytest.param(lambda: steps(3), id="three grey values: -3 %"),
        pytest.param(lambda: steps(4), id="four grey values: up to 8 %"),
        pytest.param(doublets, id="unequal doublets"),
        pytest.param(thresholded, id="a threshold, then noise"),
    ],
)
def test_edges_that_no_blurred_disc_has_are_doubted(image: Callable[[], Image]) -> None:
    said, found = doubts(image())
    assert len(found) > 12
    assert "are no blurred discs" in said


def test_small_droplets_far_out_of_focus_are_counted() -> None:
    """A quarter of the droplets was too pale to be told: D10 was 15 % too large."""
    behind = out_of_focus([(x, y, 4.5) for x, y in PLACES[::4]])
    near = [disc for index, disc in enumerate(spread_discs()) if index % 4]
    _, found = doubts(noisy(seen(near) * behind))
    assert len(found) == len(near)
    assert found.left_out.get("faint", 0) >= 4


ROW, COLUMN = np.mgrid[: SHAPE[0], : SHAPE[1]]
GOOD: dict[str, Callable[[], Image]] = {
    "sharp": lambda: noisy(seen(spread_discs(), blur_px=0.5)),
    "blurred": lambda: noisy(seen(spread_discs(), blur_px=1.5)),
    "noisy": lambda: noisy(seen(spread_discs()), 0.06),
    "glare in the middle": lambda: noisy(rings(0.3)),
    "flattened": lambda: noisy(seen([(x, y * 0.85, size) for x, y, size in spread_discs()]), 0.02),
    "pale and dark": lambda: noisy(
        np.prod([seen(spread_discs(some=slice(k, 24, 6)), 1 - 0.13 * k) for k in range(6)], axis=0)
    ),
    "vignette": lambda: noisy(
        seen(spread_discs()) * (1 - 0.5 * ((ROW - 80) ** 2 + (COLUMN - 110) ** 2) / (80**2 + 110**2)), 0.015
    ),
    "a blotch of light": lambda: noisy(
        seen(spread_discs(some=slice(10))) * (1 - 0.07 * np.exp(-((ROW - 120) ** 2 + (COLUMN - 100) ** 2) / 1800)), 0.02
    ),
}


@pytest.mark.parametrize("name", GOOD)
def test_what_discs_explain_stays_good(name: str) -> None:
    said, found = doubts(GOOD[name]())
    assert said == ""
    assert found.left_out == {}


@pytest.mark.parametrize("bright", [False, True])
def test_pixels_that_fail_alone_are_no_droplets(bright: bool) -> None:
    image = noisy(1.05 - seen(spread_discs()) if bright else seen(spread_discs()))
    image[tuple(np.random.default_rng(7).integers(3, np.array(SHAPE) - 3, (30, 2)).T)] = 230 if bright else 0
    said, found = doubts(image, bright)
    assert (said, found.left_out) == ("", {})


@pytest.mark.parametrize("quality", [95, 80])
def test_compressed_images_stay_good(quality: int) -> None:
    _, coded = cv2.imencode(".jpg", noisy(seen(spread_discs())).astype(np.uint8), [cv2.IMWRITE_JPEG_QUALITY, quality])
    said, found = doubts(np.asarray(cv2.imdecode(coded, cv2.IMREAD_GRAYSCALE), np.float32))
    assert (said, found.left_out) == ("", {})
