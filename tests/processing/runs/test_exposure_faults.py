"""What is told of the images of an exposure."""

import numpy as np
import pytest

from daq.files.run_directory import DoubleFrame, ExposureRecord, ImageKey, Shot
from processing.preprocessing import Intensity
from processing.runs.exposure_faults import copied, odd_lights
from processing.runs.seen_views import SeenView


def grey_shot(index: int, grey: int, speck: int = 0) -> Shot:
    """A shot of one view, of one grey value but for one pixel."""
    frame = np.full((32, 32), grey, np.uint8)
    frame[0, 0] += speck
    exposures = DoubleFrame(frame, None, ExposureRecord(valid=True), ExposureRecord(valid=False))
    return Shot(index, ImageKey.SAMPLE, {"view1": exposures})


def told_of(*shots: Shot) -> list[int]:
    """Shots that are told to be copies."""
    before: dict[bytes, int] = {}
    images = [np.ones((32, 32), np.float32)]
    return [shot.index for shot in shots if copied(shot, "a", images, before)]


def test_exposures_without_any_contrast_are_no_copies_of_each_other() -> None:
    assert told_of(grey_shot(0, grey=90), grey_shot(1, grey=120), grey_shot(2, grey=120)) == []


def test_exposures_with_the_very_pixels_are_copies() -> None:
    assert told_of(*(grey_shot(index, grey, speck=5) for index, grey in enumerate((90, 120, 90)))) == [2]


NOISY = np.random.default_rng(3).normal(0, 2, (64, 64))


def seen(dark: Intensity | None, background: Intensity | None) -> SeenView:
    """A view of even light, with these references."""
    return SeenView(np.rint(150 + NOISY).astype(np.uint8), 8, dark, background)


DARK, LIT = np.full((64, 64), 12, np.float32), np.full((64, 64), 150, np.float32)


@pytest.mark.parametrize(
    ("lacking", "words"), [(seen(None, LIT), "no dark image"), (seen(DARK, None), "no background")]
)
def test_a_reference_of_one_view_that_was_removed_is_told(lacking: SeenView, words: str) -> None:
    """Without its dark image shadows of one view were too pale, voxels by four views 0.8 of what they are."""
    told = odd_lights({"view1": seen(DARK, LIT), "view2": lacking}, "shadow")
    assert list(told) == ["view2"]
    assert f"has {words}, and other views have" in told["view2"]


@pytest.mark.parametrize("one", [seen(None, None), seen(None, LIT), seen(DARK, LIT)])
def test_references_that_all_views_have_or_none_are_fine(one: SeenView) -> None:
    assert odd_lights({"view1": one, "view2": one}, "shadow") == {}
