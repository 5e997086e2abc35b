import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from server.pictures.pictures import Colours, Stretch, frame_png, plane_png, preview_jpeg, to_grey


@given(st.integers(0, 2000), st.integers(550, 2000))
def test_a_stretched_frame_uses_the_whole_range_whatever_the_light(offset: int, contrast: int) -> None:
    image = (offset + contrast * np.arange(100).reshape(10, 10) // 95).astype(np.uint16)
    grey = to_grey(image, 12, Stretch.AUTO)
    assert grey.min() == 0
    assert grey.max() == 255
    assert (np.diff(grey.ravel().astype(int)) >= 0).all()


@given(st.integers(0, 245), st.integers(0, 10))
def test_noise_of_a_frame_without_contrast_is_as_dark_or_bright_as_the_frame(level: int, noise: int) -> None:
    image = (level + noise * np.arange(100).reshape(10, 10) // 99).astype(np.uint8)
    grey = to_grey(image, 8, Stretch.AUTO).astype(float)
    assert np.ptp(grey) <= 8 * noise + 1
    assert abs(grey.mean() - image.mean()) <= 8 * noise + 1


def test_a_full_stretch_shows_grey_values_as_they_are() -> None:
    image = np.array([[0, 2048, 4095]], np.uint16)
    np.testing.assert_array_equal(to_grey(image, 12, Stretch.FULL), [[0, 128, 255]])


def test_an_even_frame_is_no_error() -> None:
    assert frame_png(np.full((8, 8), 7, np.uint8), 8).startswith(b"\x89PNG")


def test_pictures_are_narrowed_and_never_widened() -> None:
    image = np.zeros((60, 80), np.uint8)
    for width_px, expected in ((40, (30, 40)), (20, (15, 20)), (160, (60, 80))):
        jpeg = preview_jpeg(image, 8, Stretch.FULL, width_px)
        picture = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_UNCHANGED)
        assert picture is not None
        assert picture.shape == expected


def test_planes_are_coloured_from_zero_to_one_limit() -> None:
    picture = cv2.imdecode(np.frombuffer(plane_png(np.array([[0, 5, 10, 20]]), 10), np.uint8), cv2.IMREAD_COLOR)
    assert picture is not None
    brightness = picture.sum(axis=2)[0]
    assert brightness[0] < brightness[1] < brightness[2] == brightness[3]


@pytest.mark.parametrize("colours", [Colours.BLUE, Colours.RED])
def test_shades_begin_with_black_and_grow_brighter(colours: Colours) -> None:
    pixels = cv2.imdecode(np.frombuffer(plane_png(np.arange(256)[None], 255, colours), np.uint8), cv2.IMREAD_COLOR)
    assert pixels is not None
    assert pixels[0, 0].tolist() == [0, 0, 0]
    assert (np.diff(pixels[0].astype(int), axis=0) >= 0).all()
    assert pixels[0, -1].argmax() == (0 if colours is Colours.BLUE else 2)
