"""What is said while targets are looked for."""

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import TypeVar

import numpy as np
import pytest

from processing.calibration.errors import CalibrationError
from processing.calibration.sets.plane_detection import PlaneImage, detect_planes
from tomoshadow import Checkerboard

T = TypeVar("T")


def test_progress_names_view_and_position() -> None:
    said = list[str]()

    def counted(items: Sequence[T], text: Callable[[T], str], /) -> Iterable[T]:
        said.extend(map(text, items))
        return items

    blank = partial(np.zeros, (90, 120), np.uint8)
    images = [PlaneImage(view, "z=1", "z 1 mm", 1.0, blank, None) for view in ("view1", "view2")]
    with pytest.raises(CalibrationError, match="never sees the target"):
        detect_planes("set", images, Checkerboard(columns=11, rows=7, pitch_mm=2.0), {}, counted=counted)
    assert said == ["target in view1, z 1 mm", "target in view2, z 1 mm"]
