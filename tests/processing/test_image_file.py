"""Images are read by content, whatever they are called."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from processing.image_file import ImageFileError, read_image


@pytest.mark.parametrize(
    ("kind", "dtype"),
    [(kind, dtype) for kind in ("png", "tif", "pgm") for dtype in (np.uint8, np.uint16)] + [("bmp", np.uint8)],
)
def test_grey_values_come_back_under_any_name(tmp_path: Path, kind: str, dtype: type[np.uint8 | np.uint16]) -> None:
    image = np.random.default_rng(1).integers(0, np.iinfo(dtype).max, (20, 30), dtype=dtype)
    cv2.imwrite(str(tmp_path / f"a.{kind}"), image)
    (tmp_path / f"a.{kind}").rename(tmp_path / "cam1.10003")
    read = read_image(tmp_path / "cam1.10003")
    assert read.dtype == dtype
    np.testing.assert_array_equal(read, image)


@pytest.mark.parametrize("channels", [3, 4])
def test_colour_becomes_grey(tmp_path: Path, channels: int) -> None:
    image = np.full((8, 9, channels), 77, np.uint8)
    cv2.imwrite(str(tmp_path / "a.png"), image)
    np.testing.assert_array_equal(read_image(tmp_path / "a.png"), np.full((8, 9), 77, np.uint8))


def test_float_images_are_refused(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "a.tiff"), np.zeros((4, 4), np.float32))
    with pytest.raises(ImageFileError, match=r"a\.tiff: grey values of type float32"):
        read_image(tmp_path / "a.tiff")


@pytest.mark.parametrize("content", [b"", b"not an image"])
def test_other_files_are_refused_by_name(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a.png").write_bytes(content)
    with pytest.raises(ImageFileError, match=r"a\.png: not an image"):
        read_image(tmp_path / "a.png")
    with pytest.raises(ImageFileError, match=r"b\.png: No such file"):
        read_image(tmp_path / "b.png")
