"""Images of recorded shots as the measurement of droplets takes them: not clipped, so that noise can be judged."""

import numpy as np

from daq.files.run_directory import RunReader, Shot
from processing.preprocessing import Intensity, transmission
from processing.runs.errors import PipelineError
from processing.runs.exposure_faults import grey_values
from processing.runs.results_file import FrameName
from processing.runs.workbench import References


def bright_images(run: RunReader, shot: Shot, frame: FrameName, references: References) -> list[Intensity]:
    """Images of one exposure less dark, over the full scale; not clipped, so that noise can be judged."""
    images = []
    for view in shot.views:
        dark = references[view][0]
        grey = grey_values(shot, view, frame).astype(np.float32)
        if dark is not None:
            grey -= dark["ab".index(frame)]
        images.append(grey / np.float32(2 ** run.header.views[view].bits - 1))
    return images


def shadow_images(
    run: RunReader, shot: Shot, frame: FrameName, references: References
) -> tuple[list[Intensity], list[Intensity]]:
    """Transmissions of one exposure by the run's own backgrounds, and how sure each pixel is."""
    number, images, trust = "ab".index(frame), [], []
    for view in shot.views:
        dark, background = references[view]
        if background is None:
            raise PipelineError(_no_background(run, view))
        level = np.float32(0) if dark is None else dark[number]
        grey = grey_values(shot, view, frame).astype(np.float32)
        image, sure = transmission(grey, level, background[number], bits=run.header.views[view].bits)
        images.append(image)
        trust.append(sure)
    return images, trust


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
