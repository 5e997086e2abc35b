"""Is a shot what it should be: every exposure there, and light in each of them? Pure.

A frame without light shows in its bright level, the 90th percentile: the median would take a spray that covers
more than half of the image for darkness. If A is bright and B dark, the second pulse was lost or fell into A;
that is a fault of the light, not a lost frame, and firing again would not prove anything.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from daq.errors import InvalidShots
from daq.files.run_directory import ReferenceImages
from daq.shot import DoubleFrame, Image, Shot

LIT_FRACTION_OF_SCALE = 0.06
"""Without references: a lit shadowgraph lies far above this part of full scale, the dark level of a sensor below."""
LIT_FRACTION_OF_BACKGROUND = 0.1
"""With references: part of the way from dark to background."""
_BRIGHT_PERCENT = 90
_STRIDE_PX = 8
"""A percentile needs no more than every eighth row and column: 30 000 pixels of a 2 MP frame, 0.4 ms."""

Thresholds = Mapping[str, tuple[float, float]]
"""Counts per view, for frames A and B, above which a bright level means light."""


@dataclass(frozen=True)
class ShotFindings:
    """What is wrong with a shot; all are empty if nothing is.

    Parameters
    ----------
    missing : tuple[str, ...]
        Exposures that did not arrive.
    unlit : tuple[str, ...]
        Exposures that arrived without light although their view should be lit.
    misfired : str
        How the fired pulse train differs from the one asked for.
    """

    missing: tuple[str, ...] = ()
    unlit: tuple[str, ...] = ()
    misfired: str = ""

    @property
    def good(self) -> bool:
        """Nothing is wrong."""
        return not (self.missing or self.unlit or self.misfired)

    def __str__(self) -> str:
        texts = [f"no exposure {name}" for name in self.missing] + [f"no light in {name}" for name in self.unlit]
        return ", ".join(texts + ([f"fired otherwise: {self.misfired}"] if self.misfired else []))


class InvalidStreak:
    """Counts invalid shots: a run whose shots are all invalid measures nothing, and its light is switched off.

    Parameters
    ----------
    limit : int
        So many in a row end the run.
    look : Callable[[Shot], ShotFindings]
        Says what is wrong with an invalid shot.
    """

    def __init__(self, limit: int, look: Callable[[Shot], ShotFindings]) -> None:
        self._limit = limit
        self._look = look
        self._in_a_row = 0
        self._valid = 0
        self._last = ""

    def count(self, shot: Shot) -> None:
        """Count one more shot; InvalidShots if it is one invalid shot too many."""
        self._valid += shot.valid
        self._in_a_row = 0 if shot.valid else self._in_a_row + 1
        if not shot.valid:
            self._last = f"shot {shot.index}: {self._look(shot)}"
        if self._in_a_row >= self._limit:
            raise InvalidShots(f"{self._in_a_row} shots in a row are invalid; {self._last}")

    def require_a_valid_one(self) -> None:
        """Raise InvalidShots if not one shot was valid."""
        if not self._valid:
            raise InvalidShots(f"none of {self._in_a_row} shots is valid; {self._last}")


def light_thresholds(bits: Mapping[str, int], dark: ReferenceImages, background: ReferenceImages) -> Thresholds:
    """Thresholds from the mean dark and background images, or from full scale where a view has no background."""
    thresholds = {}
    for view, depth in bits.items():
        low = [bright_level(image) for image in dark[view]] if view in dark else [0.0, 0.0]
        if view in background:
            high = [bright_level(image) for image in background[view]]
            levels = [a + LIT_FRACTION_OF_BACKGROUND * (b - a) for a, b in zip(low, high, strict=True)]
        else:
            levels = [LIT_FRACTION_OF_SCALE * (2**depth - 1)] * 2
        thresholds[view] = (levels[0], levels[1])
    return thresholds


def check_exposures(
    views: Mapping[str, DoubleFrame], lit: Mapping[str, bool], thresholds: Thresholds, misfired: str = ""
) -> ShotFindings:
    """Look for exposures that are missing, and for dark ones of the views that should be lit."""
    missing: list[str] = []
    unlit: list[str] = []
    for view, double_frame in views.items():
        exposures = (
            ("A", double_frame.frame_a, double_frame.record_a),
            ("B", double_frame.frame_b, double_frame.record_b),
        )
        for (name, image, record), threshold in zip(exposures, thresholds[view], strict=True):
            if image is None:
                continue
            if not record.valid:
                missing.append(f"{name} of {view}")
            elif lit[view] and bright_level(image) < threshold:
                unlit.append(f"{name} of {view}")
    return ShotFindings(tuple(missing), tuple(unlit), misfired)


def bright_level(image: Image | np.ndarray) -> float:
    """Grey value that a tenth of an image (row, column) exceeds, from a coarse sample of it."""
    return float(np.percentile(image[::_STRIDE_PX, ::_STRIDE_PX], _BRIGHT_PERCENT))
