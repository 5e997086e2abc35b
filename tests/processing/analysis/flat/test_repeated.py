"""Droplets of single images that are counted more than once: both exposures in one, frames of a film, dust."""

import numpy as np
import pytest

from processing.analysis.flat.repeated import Discs, counted_twice

SIZE_PX = np.array([900.0, 600.0])


def spray(seed: int, count: int = 30) -> Discs:
    rng = np.random.default_rng(seed)
    return rng.uniform(0, SIZE_PX, (count, 2)), rng.lognormal(np.log(12), 0.5, count)


def moved(droplets: Discs, along_px: float, down_px: float, seed: int = 9) -> Discs:
    """The same droplets, each by a little more or less, measured again."""
    rng = np.random.default_rng(seed)
    centres_px, diameters_px = droplets
    step_px = np.array([along_px, down_px]) + rng.normal(0, 1.5 * np.hypot(along_px, down_px) / 20, centres_px.shape)
    return centres_px + step_px, diameters_px * rng.normal(1, 0.02, len(diameters_px))


def together(*parts: Discs) -> Discs:
    centres_px, diameters_px = zip(*parts, strict=True)
    return np.concatenate(centres_px), np.concatenate(diameters_px)


def test_sprays_of_their_own_are_not_doubted() -> None:
    assert counted_twice({str(seed): spray(seed, 20 * seed) for seed in range(1, 12)}) == ()
    assert counted_twice({"none": spray(1, 0), "one": spray(1, 1), "few": spray(2, 4)}) == ()


@pytest.mark.parametrize(("along", "down"), [(0.0, 1.0), (1.0, 0.0)], ids=["above", "beside"])
def test_both_exposures_in_one_image_are_told(along: float, down: float) -> None:
    a, shift_px = spray(1), SIZE_PX * (along, down)
    b = moved(a, 4, 12)
    (said,) = counted_twice({"double": together(a, (b[0] + shift_px, b[1]))})
    assert said.startswith("double: ")
    assert "are both exposures in one image? Their droplets count twice" in said


def test_frames_of_a_film_are_told() -> None:
    first = spray(1)
    second = together(moved(first, 5, 18), spray(2, 8))
    (said,) = counted_twice({"a": first, "b": second, "other": spray(3)})
    assert said.startswith("a and b: ")
    assert "frames of a film? Droplets count twice" in said


def test_dust_is_told_once_for_all_images() -> None:
    dust = spray(7, 5)
    images = {f"image{seed}": together(moved(dust, 0.1, 0, seed), spray(seed)) for seed in range(6)}
    (said,) = counted_twice(images)
    assert said == (
        "image0 and image1: 5 droplets are in both, in the same place, and in 4 more cases: is it dust on a window? "
        "It counts in every image; give the light without droplets (--background)"
    )


def test_a_lattice_of_dots_is_no_double_exposure() -> None:
    rows, columns = np.mgrid[40:600:60, 40:900:60]
    centres_px = np.column_stack([columns.ravel(), rows.ravel()]).astype(np.float64)
    assert counted_twice({"reticle": (centres_px, np.full(len(centres_px), 12.0))}) == ()
