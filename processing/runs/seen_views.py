"""What each camera saw in an exposure, beside its dark and its background: found once, for all that is asked of it."""

from collections.abc import Mapping
from dataclasses import dataclass

from daq.files.run_directory import RunReader, Shot
from processing.preprocessing import Frame, Intensity
from processing.runs.errors import PipelineError
from processing.runs.results_file import FrameName
from processing.runs.workbench import References


@dataclass(frozen=True, eq=False)
class SeenView:
    """Pixels of a view as they were recorded, and those of its references.

    Parameters
    ----------
    grey : (rows, columns) array
        Grey values.
    bits : int
        How many of them are significant.
    dark, background : (rows, columns) array, optional
        Of the same exposure; None where there is none.
    """

    grey: Frame
    bits: int
    dark: Intensity | None
    background: Intensity | None


def seen_views(run: RunReader, shot: Shot, frame: FrameName, references: References) -> dict[str, SeenView]:
    """All views of an exposure; PipelineError if one is missing."""
    seen = {}
    for view in shot.views:
        dark, background = (None if one is None else one["ab".index(frame)] for one in references[view])
        seen[view] = SeenView(grey_values(shot, view, frame), run.header.views[view].bits, dark, background)
    return seen


def other_backgrounds(seen: Mapping[str, SeenView], view: str) -> dict[str, Intensity]:
    """Backgrounds that may be exchanged with that of a view, and what they are called."""
    return {
        f"that of {name}": one.background for name, one in seen.items() if name != view and one.background is not None
    }


def grey_values(shot: Shot, view: str, frame: FrameName) -> Frame:
    """Pixels of an exposure as they were recorded; PipelineError if it is missing."""
    exposures = shot.views[view]
    pixels = exposures.frame_a if frame == "a" else exposures.frame_b
    if pixels is None:
        raise PipelineError(f"shot {shot.index}: {view} has no exposure {frame}")
    return pixels
