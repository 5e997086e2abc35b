"""Images are read by content, whatever they are called."""

import struct
from pathlib import Path
from typing import Any, Literal

import cv2
import numpy as np
import pytest
import tifffile
from PIL import Image

from processing.image_file import ImageFileError, page_count, read_image


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
    image[..., 3:] = 255
    cv2.imwrite(str(tmp_path / "a.png"), image)
    np.testing.assert_array_equal(read_image(tmp_path / "a.png"), np.full((8, 9), 77, np.uint8))


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("channel", range(3))
def test_a_colour_alone_is_no_grey(tmp_path: Path, channel: int, dtype: type[np.uint8 | np.uint16]) -> None:
    """A weighted mean would take 30 % of red, 59 % of green and 11 % of blue for the light."""
    image = np.zeros((8, 9, 3), dtype)
    image[2:5, 3:6, channel] = np.iinfo(dtype).max // 2
    cv2.imwrite(str(tmp_path / "a.png"), image)
    with pytest.raises(ImageFileError, match=r"a\.png: is coloured at column 3, row 2: red .*, green .*, blue .*grey"):
        read_image(tmp_path / "a.png")


def test_a_grey_jpeg_in_colours_is_grey(tmp_path: Path) -> None:
    grey = np.random.default_rng(1).integers(0, 255, (40, 50), np.uint8)
    Image.fromarray(np.dstack([grey] * 3)).save(tmp_path / "a.jpg", quality=60)
    assert read_image(tmp_path / "a.jpg").shape == grey.shape


def test_an_image_that_is_partly_seen_through_is_not_what_a_camera_saw(tmp_path: Path) -> None:
    image = np.full((8, 9, 4), 255, np.uint8)
    image[1, 2, 3] = 128
    cv2.imwrite(str(tmp_path / "a.png"), image)
    with pytest.raises(ImageFileError, match=r"a\.png: is transparent at column 2, row 1"):
        read_image(tmp_path / "a.png")


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


STORED = np.arange(24, dtype=np.uint8).reshape(4, 6)


@pytest.mark.parametrize("orientation", range(1, 9))
@pytest.mark.parametrize("kind", ["tif", "png"])
def test_pixels_lie_as_stored_whatever_an_orientation_tag_asks_for(tmp_path: Path, kind: str, orientation: int) -> None:
    tags = Image.Exif()
    tags[274] = orientation
    Image.fromarray(STORED).save(tmp_path / f"a.{kind}", exif=tags)
    np.testing.assert_array_equal(read_image(tmp_path / f"a.{kind}"), STORED)


def test_a_jpeg_lies_as_stored_too(tmp_path: Path) -> None:
    tags = Image.Exif()
    tags[274] = 3
    halves = np.repeat(np.array([0, 255], np.uint8), 32)[None, :].repeat(16, axis=0)
    Image.fromarray(halves).save(tmp_path / "a.jpg", exif=tags)
    np.testing.assert_allclose(read_image(tmp_path / "a.jpg"), halves, atol=3)


STACK = np.random.default_rng(1).integers(0, 2**16, (3, 5, 7), dtype=np.uint16)


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("big", [False, True])
def test_every_page_of_a_stack_can_be_read(tmp_path: Path, order: Literal["<", ">"], big: bool) -> None:
    with tifffile.TiffWriter(tmp_path / "a.tif", bigtiff=big, byteorder=order) as stack:
        for image in STACK:
            stack.write(image, photometric="minisblack", contiguous=False, extratags=[(274, 3, 1, 3, True)])
    before = (tmp_path / "a.tif").read_bytes()
    assert page_count(tmp_path / "a.tif") == 3
    for page, image in enumerate(STACK):
        np.testing.assert_array_equal(read_image(tmp_path / "a.tif", page), image)
    assert (tmp_path / "a.tif").read_bytes() == before


def test_a_stack_is_not_read_without_a_word_which_page(tmp_path: Path) -> None:
    tifffile.imwrite(tmp_path / "a.tif", STACK, photometric="minisblack")
    with pytest.raises(ImageFileError, match=r"a\.tif: holds 3 images; say by page = 0 to 2 which one is meant"):
        read_image(tmp_path / "a.tif")
    with pytest.raises(ImageFileError, match=r"a\.tif: has no page 3, it holds 3 images, the first one is page 0"):
        read_image(tmp_path / "a.tif", 3)


@pytest.mark.parametrize("depth", [8, 24])
def test_a_sun_raster_is_not_read_as_zeros(tmp_path: Path, depth: int) -> None:
    header = np.array([0x59A66A95, 8, 4, depth, 32 * depth // 8, 1, 0, 0], ">u4").tobytes()
    (tmp_path / "a.ras").write_bytes(header + bytes(range(32)) * (depth // 8))
    with pytest.raises(ImageFileError, match=r"a\.ras: not an image"):
        read_image(tmp_path / "a.ras")


@pytest.mark.parametrize("kind", ["gif", "png", "webp"])
def test_an_animation_is_not_read_by_its_first_image(tmp_path: Path, kind: str) -> None:
    first, *others = (Image.fromarray(np.full((8, 9), value, np.uint8)) for value in (10, 100, 200))
    first.save(tmp_path / f"a.{kind}", save_all=True, append_images=others)
    for read in (read_image, page_count):
        with pytest.raises(ImageFileError, match=rf"a\.{kind}: is an animation of 3 images"):
            read(tmp_path / f"a.{kind}")


def test_a_torn_stack_is_no_image(tmp_path: Path) -> None:
    tifffile.imwrite(tmp_path / "a.tif", STACK, photometric="minisblack")
    whole = (tmp_path / "a.tif").read_bytes()
    for length in (3, 7, 9, 12, 40):
        (tmp_path / "torn.tif").write_bytes(whole[:length])
        with pytest.raises(ImageFileError, match=r"torn\.tif: not an image"):
            read_image(tmp_path / "torn.tif")


@pytest.mark.parametrize("kind", ["tif", "png", "jpg", "bmp", "pgm"])
def test_a_damaged_file_is_read_or_refused(tmp_path: Path, kind: str) -> None:
    rng = np.random.default_rng(1)
    cv2.imwrite(str(tmp_path / f"whole.{kind}"), rng.integers(0, 255, (9, 8), dtype=np.uint8))
    whole = np.fromfile(tmp_path / f"whole.{kind}", np.uint8)
    refused = 0
    for _ in range(100):
        damaged = whole[: rng.integers(1, len(whole) + 1)].copy()
        damaged[rng.integers(0, len(damaged), 2)] = rng.integers(0, 256, 2)
        damaged.tofile(tmp_path / f"damaged.{kind}")
        try:
            assert read_image(tmp_path / f"damaged.{kind}").ndim == 2
        except ImageFileError:
            refused += 1
    assert refused


NOISY = np.random.default_rng(2).integers(90, 110, (40, 50), dtype=np.uint8)


def flipped(file: Path, bit: int) -> None:
    """Flip a bit of a file."""
    content = np.fromfile(file, np.uint8)
    content[bit // 8] ^= 1 << bit % 8
    content.tofile(file)


@pytest.mark.parametrize("layout", [{}, {"tile": (16, 16)}, {"bigtiff": True, "byteorder": ">"}, {"rowsperstrip": 40}])
def test_a_flipped_bit_of_deflated_pixels_is_never_a_grey_value(tmp_path: Path, layout: dict[str, Any]) -> None:
    """Stored blocks: every bit is one of a pixel, and only the checksum knows."""
    tifffile.imwrite(tmp_path / "a.tif", NOISY, compression="zlib", compressionargs={"level": 0}, **layout)
    np.testing.assert_array_equal(read_image(tmp_path / "a.tif"), NOISY)
    whole = np.fromfile(tmp_path / "a.tif", np.uint8)
    place = whole.tobytes().index(NOISY[0, :16].tobytes())
    flipped(tmp_path / "a.tif", 8 * place + 3)
    with pytest.raises(ImageFileError, match=r"a\.tif: is damaged"):
        read_image(tmp_path / "a.tif")


def test_what_is_wrong_with_a_jpeg_is_no_line_that_nobody_reads(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    cv2.imwrite(str(tmp_path / "a.jpg"), NOISY)
    read_image(tmp_path / "a.jpg")
    content = (tmp_path / "a.jpg").read_bytes()
    (tmp_path / "a.jpg").write_bytes(content[:-200] + content[-100:])
    with pytest.raises(ImageFileError, match=r"a\.jpg: is damaged: .*JPEG"):
        read_image(tmp_path / "a.jpg")
    assert capfd.readouterr().err == ""


def test_a_stack_that_was_cut_is_not_a_shorter_one(tmp_path: Path) -> None:
    """libtiff writes the directory of a page after its pixels, so the pages before are whole."""
    cv2.imwritemulti(str(tmp_path / "whole.tif"), list(STACK), [cv2.IMWRITE_TIFF_COMPRESSION, 1])
    whole = (tmp_path / "whole.tif").read_bytes()
    for length in range(len(whole) // 3 + 20, len(whole) - 20, 20):
        (tmp_path / "cut.tif").write_bytes(whole[:length])
        for read in (read_image, page_count):
            with pytest.raises(ImageFileError, match=r"cut\.tif: holds more than [12] images"):
                read(tmp_path / "cut.tif")


def test_images_that_a_file_does_not_list_are_not_left_out(tmp_path: Path) -> None:
    tifffile.imwrite(tmp_path / "imagej.tif", STACK, imagej=True, truncate=True)
    deep = np.zeros((4, 16, 16), np.uint16)
    tifffile.imwrite(tmp_path / "deep.tif", deep, volumetric=True, tile=(4, 16, 16), photometric="minisblack")
    header = b"P5 # by the frame grabber\n8 4\n255\n"
    (tmp_path / "two.pgm").write_bytes(2 * (header + bytes(range(32))))
    for file, holds in (("imagej.tif", "3 images"), ("deep.tif", "4 images"), ("two.pgm", "several images")):
        for read in (read_image, page_count):
            with pytest.raises(ImageFileError, match=f"{file}: holds {holds}"):
                read(tmp_path / file)


def test_directories_in_a_circle_end(tmp_path: Path) -> None:
    circle = b"II*\0" + struct.pack("<IHHHIII", 8, 1, 256, 3, 1, 4, 8)
    (tmp_path / "a.tif").write_bytes(circle)
    assert page_count(tmp_path / "a.tif") == 1


@pytest.mark.parametrize(
    ("written", "complaint"),
    [
        ({"photometric": "miniswhite"}, "counts light from white, 0, to black"),
        ({"subfiletype": 1}, "holds a preview of an image"),
        ({"extrasamples": ["unspecified"]}, "has 16 bits, of which only 8 can be read"),
        ({"photometric": "rgb", "planarconfig": "separate"}, "colours of 16 bits in separate planes"),
    ],
)
def test_a_page_that_would_be_read_otherwise_than_it_is_meant_is_refused(
    tmp_path: Path, written: dict[str, Any], complaint: str
) -> None:
    grey = np.arange(600, dtype=np.uint16).reshape(20, 30)
    image = np.dstack([grey, grey]) if "extrasamples" in written else grey
    image = np.stack([grey, grey, grey]) if "planarconfig" in written else image
    tifffile.imwrite(tmp_path / "odd.tif", image, **{"photometric": "minisblack", **written})
    with pytest.raises(ImageFileError, match=complaint):
        read_image(tmp_path / "odd.tif")


def test_white_may_be_0_where_that_is_understood(tmp_path: Path) -> None:
    grey = np.arange(240, dtype=np.uint8).reshape(12, 20)
    tifffile.imwrite(tmp_path / "white.tif", 255 - grey, photometric="miniswhite")
    np.testing.assert_array_equal(read_image(tmp_path / "white.tif"), grey)


def pam(kind: str, pixels: np.ndarray[Any, Any], brightest: int) -> bytes:
    """A file of the format that came after PGM, where what the values are is a word."""
    rows, columns, *depth = pixels.shape
    header = f"P7\nWIDTH {columns}\nHEIGHT {rows}\nDEPTH {depth[0] if depth else 1}\nMAXVAL {brightest}\n"
    return f"{header}TUPLTYPE {kind}\nENDHDR\n".encode() + pixels.astype(">u2" if brightest > 255 else "u1").tobytes()


@pytest.mark.parametrize("brightest", [127, 255, 4095, 65535])
def test_grey_values_of_a_pam_are_those_of_the_file(tmp_path: Path, brightest: int) -> None:
    grey = np.linspace(0, brightest, 60 * 80).astype(np.uint16).reshape(60, 80)
    (tmp_path / "grey.pam").write_bytes(pam("GRAYSCALE", grey, brightest))
    np.testing.assert_array_equal(read_image(tmp_path / "grey.pam"), grey)


@pytest.mark.parametrize(
    "content",
    [
        pam("RGB", np.dstack([np.full((60, 80), level, np.uint8) for level in (250, 100, 10)]), 255),
        pam("BLACKANDWHITE", np.ones((60, 80), np.uint8), 1),
        pam("GRAYSCALE", np.ones((60, 80), np.uint8), 255) * 2,
        b"P7\nWIDTH 80\nHEIGHT 60\nDEPTH 1\nMAXVAL 255\nENDHDR\n" + bytes(4800),
    ],
    ids=["colour", "bits", "stack", "no word"],
)
def test_a_pam_of_anything_else_is_refused(tmp_path: Path, content: bytes) -> None:
    """OpenCV takes red for blue, multiplies bits, and reads the first image of several, without a word."""
    (tmp_path / "shot.pam").write_bytes(content)
    with pytest.raises(ImageFileError, match=r"shot\.pam: .* PAM .* one image of GRAYSCALE"):
        read_image(tmp_path / "shot.pam")


def test_the_first_image_of_an_mpo_is_not_the_whole_file(tmp_path: Path) -> None:
    images = [Image.fromarray(np.full((60, 80, 3), level, np.uint8)) for level in (50, 200)]
    images[0].save(tmp_path / "both.jpg", format="MPO", save_all=True, append_images=images[1:])
    for ask in (read_image, page_count):
        with pytest.raises(ImageFileError, match=r"both\.jpg: holds several images, as MPO"):
            ask(tmp_path / "both.jpg")
    images[0].save(tmp_path / "one.jpg")
    assert read_image(tmp_path / "one.jpg").shape == (60, 80)
