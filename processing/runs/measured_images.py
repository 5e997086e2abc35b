"""Images of recorded shots as the measurement of droplets takes them: not clipped, so that noise can be judged.

Rectangles of shadow images can be left unasked: a nozzle, a reflection, dirt on a window.
"""

import re
from collections.abc import Mapping, Sequence
from typing import Annotated

import numpy as np
from pydantic import Field

from daq.files.run_directory import RunReader, Shot
from processing.light import odd_background
from processing.preprocessing import Intensity, transmission
from processing.runs.errors import PipelineError
from processing.runs.results_file import FrameName
from processing.runs.seen_views import other_backgrounds, seen_views
from processing.runs.workbench import References

_PATTERN = r"^([^=]+)=(\d+):(\d+),(\d+):(\d+)$"
IgnoredPixels = Annotated[str, Field(pattern=_PATTERN)]
"""``VIEW=LEFT:RIGHT,TOP:BOTTOM``: columns and rows of a view, the first ones and those after the last."""


def bright_images(run: RunReader, shot: Shot, frame: FrameName, references: References) -> list[Intensity]:
    """Images of one exposure less dark, over the full scale; not clipped, so that noise can be judged."""
    images = []
    for one in seen_views(run, shot, frame, references).values():
        grey = one.grey.astype(np.float32)
        if one.dark is not None:
            grey -= one.dark
        images.append(grey / np.float32(2**one.bits - 1))
    return images


def shadow_images(
    run: RunReader, shot: Shot, frame: FrameName, references: References
) -> tuple[list[Intensity], list[Intensity]]:
    """Transmissions of one exposure by the run's own backgrounds, and how sure each pixel is."""
    images, trust = [], []
    for view, one in seen_views(run, shot, frame, references).items():
        if one.background is None:
            raise PipelineError(_no_background(run, view))
        level = np.float32(0) if one.dark is None else one.dark
        image, sure = transmission(one.grey.astype(np.float32), level, one.background, bits=one.bits)
        images.append(image)
        trust.append(sure)
    return images, trust


def odd_backgrounds(run: RunReader, shot: Shot, frame: FrameName, references: References) -> tuple[str, ...]:
    """What speaks against the backgrounds of an exposure of shadows, by view: that they show it, or are another's."""
    seen, told = seen_views(run, shot, frame, references), []
    for view, one in seen.items():
        others = other_backgrounds(seen, view)
        if one.background is not None and (odd := odd_background(one.grey, one.background, one.dark, others)):
            told.append(f"{view} {odd}")
    return tuple(told)


def require_backgrounds(run: RunReader, references: References) -> None:
    """Refuse a run of shadows without a background.

    Raises
    ------
    PipelineError
        The text names the view, and says what to do.
    """
    for view, (_, background) in references.items():
        if background is None:
            raise PipelineError(_no_background(run, view))


def _no_background(run: RunReader, view: str) -> str:
    return (
        f"{run.run_dir.name}: {view} has no background, and without one nobody knows how much light a droplet takes: "
        "record one with light and without spray, or import it ([[run.background]])"
    )


def require_fitting(ignored: Sequence[str], sizes_px: Mapping[str, tuple[int, int]]) -> None:
    """Refuse rectangles of no view, without pixels, or beyond an image.

    Parameters
    ----------
    ignored : sequence of IgnoredPixels
        What is not asked.
    sizes_px : Mapping[str, tuple[int, int]]
        (width, height) of the image of every view.

    Raises
    ------
    PipelineError
        The text names the rectangle, and what it must lie in.
    """
    for text in ignored:
        view, (columns, rows) = rectangle(text)
        if view not in sizes_px:
            raise PipelineError(f"pixels to ignore, {text}: there is no view {view}; views are {', '.join(sizes_px)}")
        width, height = sizes_px[view]
        if not (columns.start < columns.stop <= width and rows.start < rows.stop <= height):
            raise PipelineError(
                f"pixels to ignore, {text}: VIEW=LEFT:RIGHT,TOP:BOTTOM must lie in the image, {width} x {height} px"
            )


def without_ignored(trust: Mapping[str, Intensity], ignored: Sequence[str]) -> dict[str, Intensity]:
    """How sure pixels (rows, columns) of every view are, 0 where they are not asked; in arrays of their own."""
    known = {view: np.array(image) for view, image in trust.items()}
    for text in ignored:
        view, (columns, rows) = rectangle(text)
        known[view][rows, columns] = 0
    return known


def rectangle(text: str) -> tuple[str, tuple[slice, slice]]:
    """View, columns and rows of pixels to ignore.

    Raises
    ------
    PipelineError
        It is written otherwise.
    """
    match = re.match(_PATTERN, text)
    if match is None:
        raise PipelineError(f"pixels to ignore, {text}: write VIEW=LEFT:RIGHT,TOP:BOTTOM, in pixels")
    view, *numbers = match.groups()
    left, right, top, bottom = map(int, numbers)
    return view, (slice(left, right), slice(top, bottom))
