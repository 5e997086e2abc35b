"""Preprocessing: what is left of an exposure is the droplet, whatever the light, the dust and the dark level."""

from typing import Literal

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from processing.preprocessing import Preprocessing, intensity, sliding_minimum
from tests.support import preprocessing_oracle as oracle

ROWS, COLUMNS = 120, 160
BITS = 12


def scene(transmittance: NDArray[np.float64], level: float = 2000.0) -> NDArray[np.uint16]:
    """Exposure of a transmittance with uneven light, dust and a dark level of 60."""
    row, column = np.mgrid[:ROWS, :COLUMNS]
    field = level * (1 - 0.4 * ((row - 60) ** 2 + (column - 80) ** 2) / 10_000)
    field[30:34, 100:104] *= 0.3
    exposure: NDArray[np.uint16] = np.round(60 + field * transmittance).astype(np.uint16)
    return exposure


def references() -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    dark = np.full((ROWS, COLUMNS), 60, np.float32)
    return dark, scene(np.ones((ROWS, COLUMNS))).astype(np.float32)


def droplet() -> NDArray[np.float64]:
    transmittance = np.ones((ROWS, COLUMNS))
    transmittance[50:55, 70:75] = 0.2
    return transmittance


def test_background_division_leaves_only_the_droplet() -> None:
    dark, background = references()
    settings = Preprocessing(minimum_window_px=0, noise_floor=0)
    result = intensity(scene(droplet()), settings, bits=BITS, dark=dark, background=background)
    np.testing.assert_allclose(result, 1 - droplet(), atol=2e-3)


@pytest.mark.parametrize("level", [500.0, 2000.0, 3900.0])
def test_result_does_not_depend_on_the_brightness(level: float) -> None:
    dark = np.full((ROWS, COLUMNS), 60, np.float32)
    background = scene(np.ones((ROWS, COLUMNS)), level).astype(np.float32)
    result = intensity(scene(droplet(), level), Preprocessing(), bits=BITS, dark=dark, background=background)
    assert result[52, 72] == pytest.approx((0.8 - 0.05) / 0.95, abs=0.01)
    assert result[10, 10] == 0


def test_sliding_minimum_removes_a_veil_but_keeps_the_droplet() -> None:
    dark, background = references()
    settings = Preprocessing(minimum_window_px=41, noise_floor=0)
    result = intensity(scene(0.7 * droplet()), settings, bits=BITS, dark=dark, background=background)
    assert result[52, 72] == pytest.approx(0.56, abs=0.01)
    assert result[100, 20] == pytest.approx(0.0, abs=0.01)


def test_without_background_the_light_field_is_estimated() -> None:
    result = intensity(scene(droplet()), Preprocessing(minimum_window_px=41), bits=BITS)
    assert result[52, 72] > 0.6
    assert np.median(result) < 0.02


def test_bright_particles_stay_bright() -> None:
    frame = np.full((ROWS, COLUMNS), 10, np.uint8)
    frame[40, 50] = 255
    result = intensity(frame, Preprocessing("bright", minimum_window_px=21, noise_floor=0), bits=8)
    assert result[40, 50] == pytest.approx(245 / 255, abs=1e-3)
    assert result[80, 80] == pytest.approx(0, abs=1e-6)


def test_sliding_minimum_is_the_minimum_of_a_constant_window() -> None:
    image = np.full((50, 60), 0.3, np.float32)
    image[20:23, 30:33] = 0.9
    np.testing.assert_allclose(sliding_minimum(image, 11), 0.3, atol=1e-6)


def test_dark_background_carries_no_information() -> None:
    nothing = np.zeros((2, 2), np.float32)
    settings = Preprocessing(minimum_window_px=0, noise_floor=0)
    assert intensity(nothing.astype(np.uint8), settings, bits=8, background=nothing).max() == 0


def test_references_of_another_size_are_refused() -> None:
    with pytest.raises(ValueError, match=r"background image \(3, 3\) does not fit the frame \(120, 160\)"):
        intensity(scene(droplet()), Preprocessing(), bits=BITS, background=np.ones((3, 3), np.float32))


def test_frames_of_another_type_are_refused() -> None:
    with pytest.raises(ValueError, match="uint8 or uint16, not float64"):
        intensity(np.ones((3, 3)), Preprocessing(), bits=BITS)  # type: ignore[arg-type]


def random_exposure(
    shape: tuple[int, int], bits: int, seed: int
) -> tuple[NDArray[np.uint8] | NDArray[np.uint16], NDArray[np.float32], NDArray[np.float32]]:
    """Frame, dark and background image; some of the background is as dark as the dark image."""
    rng = np.random.default_rng(seed)
    full_scale = 2**bits - 1
    frame = (full_scale * rng.beta(3, 2, shape)).astype(np.uint8 if bits == 8 else np.uint16)
    dark = (0.05 * full_scale * rng.random(shape)).astype(np.float32)
    background = dark + full_scale * np.where(rng.random(shape) < 0.05, 0.0, rng.uniform(0.3, 0.9, shape))
    return frame, dark, background.astype(np.float32)


@pytest.mark.parametrize("polarity", ["shadow", "bright"])
@pytest.mark.parametrize("bits", [8, 12, 16])
def test_intensities_equal_the_textbook(isa: str, bits: int, polarity: Literal["shadow", "bright"]) -> None:
    @settings(max_examples=12)
    @given(
        shape=st.tuples(st.integers(1, 90), st.integers(1, 150)),
        window_px=st.sampled_from([0, 1, 2, 3, 16, 31, 64, 65, 201, 333]),
        with_dark=st.booleans(),
        with_background=st.booleans(),
        seed=st.integers(0, 1000),
        threads=st.integers(1, 3),
    )
    def check(
        shape: tuple[int, int], window_px: int, with_dark: bool, with_background: bool, seed: int, threads: int
    ) -> None:
        frame, dark, background = random_exposure(shape, bits, seed)
        how = Preprocessing(polarity, window_px, noise_floor=0.03)
        references = {"dark": dark if with_dark else None, "background": background if with_background else None}
        expected = oracle.intensity(frame, how, bits=bits, **references)
        result = intensity(frame, how, bits=bits, threads=threads, **references)
        # sums of a window in single precision, along columns and rows: half a rounding for each of their terms
        np.testing.assert_allclose(result, expected, atol=1e-6 + (window_px or 201) * 2.0**-24)

    check()


@pytest.mark.parametrize("window_px", [1, 7, 32, 65, 201, 2001])
def test_sliding_minimum_equals_erosion_and_mean(isa: str, window_px: int) -> None:
    image = np.random.default_rng(window_px).uniform(0.2, 1, (130, 217)).astype(np.float32)
    expected = oracle.sliding_minimum(image.astype(float), window_px)
    rounding = (window_px + 16) * float(np.finfo(np.float32).eps) / 2  # of a sum down a column
    np.testing.assert_allclose(sliding_minimum(image, window_px), expected, rtol=rounding)


def test_a_veil_of_any_size_is_taken_off_alike_by_any_number_of_threads() -> None:
    frame, dark, background = random_exposure((301, 203), 12, 5)
    one, other = (
        intensity(
            frame, Preprocessing(minimum_window_px=41), bits=12, dark=dark, background=background, threads=threads
        )
        for threads in (1, 4)
    )
    np.testing.assert_array_equal(one, other)


def test_memory_of_the_result_is_reused() -> None:
    frame, dark, background = random_exposure((60, 70), 12, 6)
    fresh = intensity(frame, Preprocessing(), bits=12, dark=dark, background=background)
    used = np.full(frame.shape, np.nan, np.float32)
    result = intensity(frame, Preprocessing(), bits=12, dark=dark, background=background, out=used)
    assert result is used
    np.testing.assert_array_equal(used, fresh)


@pytest.mark.parametrize("out", [np.empty((4, 4), np.float64), np.empty((4, 8), np.float32)[:, ::2], np.empty((3, 4))])
def test_a_result_that_would_not_be_written_in_place_is_refused(out: NDArray[np.float32]) -> None:
    with pytest.raises(ValueError, match="output"):
        intensity(np.zeros((4, 4), np.uint8), Preprocessing(), bits=8, out=out)


def test_a_colour_image_is_refused_in_words() -> None:
    with pytest.raises(ValueError, match=r"\(4, 5, 3\): colour"):
        intensity(np.zeros((4, 5, 3), np.uint8), Preprocessing(), bits=8)
