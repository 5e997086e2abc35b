"""Is a shot what it should be: every exposure there, and light in each of them? Pure.

A frame without light shows in its bright level, the 90th percentile: the median would take a spray that covers
more than half of the image for darkness. If A is bright and B dark, the second pulse was lost or fell into A;
that is a fault of the light, not a lost frame, and firing again would not prove anything.
"""

from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from daq.errors import InvalidShots
from daq.files.run_directory import ReferenceImages
from daq.shot import DoubleFrame, ExposureRecord, Flaw, Image, Shot

LIT_FRACTION_OF_SCALE = 0.06
"""Without references: a lit shadowgraph lies far above this part of full scale, the dark level of a sensor below."""
LIT_FRACTION_OF_BACKGROUND = 0.1
"""With references: part of the way from dark to background."""
_BRIGHT_PERCENT = 90
_STRIDE_PX = 8
"""A percentile needs no more than every eighth row and column: 30 000 pixels of a 2 MP frame, 0.4 ms."""

DOUBLE_FRACTION_OF_BACKGROUND = 1.6
"""So far above dark, in spans from dark to background, it is the light of two pulses; a spray only takes some away."""
_FULL = 0.98
"""Of full scale: brighter ones cannot be told."""


@dataclass(frozen=True)
class LightLevels:
    """Grey values of one exposure of a view.

    Parameters
    ----------
    lit : float
        A bright level above this means light.
    doubly_lit : float
        Above this it is the light of two pulses; infinite where no background tells.
    """

    lit: float
    doubly_lit: float = np.inf


_HOW = defaultdict(str) | {
    Flaw.INCOMPLETE: " (incomplete)",
    Flaw.WRONG_SIZE: " (of wrong size)",
    Flaw.UNPROVEN: " (frames came that are not proven to be it)",
}

Thresholds = Mapping[str, tuple[LightLevels, LightLevels]]
"""Per view, for frames A and B."""


@dataclass(frozen=True)
class ShotFindings:
    """What is wrong with a shot; all are empty if nothing is.

    Parameters
    ----------
    missing : tuple[str, ...]
        Exposures that did not arrive.
    unlit, doubly_lit : tuple[str, ...]
        Exposures that arrived without light although their view should be lit, and with the light of two pulses.
    misfired : str
        How the fired pulse train differs from the one asked for.
    """

    missing: tuple[str, ...] = ()
    unlit: tuple[str, ...] = ()
    doubly_lit: tuple[str, ...] = ()
    misfired: str = ""

    @property
    def good(self) -> bool:
        """Nothing is wrong."""
        return not (self.missing or self.unlit or self.doubly_lit or self.misfired)

    def __str__(self) -> str:
        texts = [f"no exposure {name}" for name in self.missing] + [f"no light in {name}" for name in self.unlit]
        texts += [f"the light of two pulses in {name}" for name in self.doubly_lit]
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
        most = 2**depth - 1
        low = [_bright_level(image) for image in dark[view]] if view in dark else [0.0, 0.0]
        if view in background:
            high = [_bright_level(image) for image in background[view]]
            levels = [_levels(a, b, most) for a, b in zip(low, high, strict=True)]
        else:
            levels = [LightLevels(LIT_FRACTION_OF_SCALE * most)] * 2
        thresholds[view] = (levels[0], levels[1])
    return thresholds


def _levels(dark: float, background: float, most: int) -> LightLevels:
    double = dark + DOUBLE_FRACTION_OF_BACKGROUND * (background - dark)
    lit = dark + LIT_FRACTION_OF_BACKGROUND * (background - dark)
    return LightLevels(lit, double if dark < background and double < _FULL * most else np.inf)


def marked(views: Mapping[str, DoubleFrame], lit: Mapping[str, bool], thresholds: Thresholds) -> dict[str, DoubleFrame]:
    """The same views, with a flaw on each exposure that is dark although it should be lit, or doubly lit."""
    return {view: _marked(frames, lit[view], thresholds[view]) for view, frames in views.items()}


def _marked(frames: DoubleFrame, lit: bool, levels: tuple[LightLevels, LightLevels]) -> DoubleFrame:
    return replace(
        frames,
        record_a=_judged(frames.frame_a, frames.record_a, lit, levels[0]),
        record_b=_judged(frames.frame_b, frames.record_b, lit, levels[1]),
    )


def _judged(image: Image | None, record: ExposureRecord, lit: bool, levels: LightLevels) -> ExposureRecord:
    if image is None or not record.valid:
        return record
    level = _bright_level(image)
    if lit and level < levels.lit:
        return replace(record, flaw=Flaw.DARK)
    return replace(record, flaw=Flaw.DOUBLY_LIT) if level > levels.doubly_lit else record


def check_exposures(views: Mapping[str, DoubleFrame], misfired: str = "") -> ShotFindings:
    """What is wrong with the exposures of a shot, by their flaws."""
    exposures = [
        (f"{name} of {view}", record)
        for view, frames in views.items()
        for name, image, record in (("A", frames.frame_a, frames.record_a), ("B", frames.frame_b, frames.record_b))
        if image is not None
    ]
    return ShotFindings(
        missing=tuple(f"{name}{_HOW[record.flaw]}" for name, record in exposures if not record.valid),
        unlit=tuple(name for name, record in exposures if record.flaw is Flaw.DARK),
        doubly_lit=tuple(name for name, record in exposures if record.flaw is Flaw.DOUBLY_LIT),
        misfired=misfired,
    )


def _bright_level(image: Image | np.ndarray) -> float:
    """Grey value that a tenth of an image (row, column) exceeds, from a coarse sample of it."""
    return float(np.percentile(image[::_STRIDE_PX, ::_STRIDE_PX], _BRIGHT_PERCENT))
