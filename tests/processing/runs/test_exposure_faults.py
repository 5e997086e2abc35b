"""What is told of the images of an exposure."""

import numpy as np

from daq.files.run_directory import DoubleFrame, ExposureRecord, ImageKey, Shot
from processing.runs.exposure_faults import copied


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
