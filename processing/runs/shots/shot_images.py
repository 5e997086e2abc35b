"""Images of a recorded shot, as reconstruction takes them."""

from collections.abc import Sequence

from daq.files.run_directory import RunReader, Shot
from processing.calibration.calibration import Calibration
from processing.kernels import DEFAULT_THREADS
from processing.preprocessing import Intensity, intensity
from processing.reconstruction.settings import ReconstructionSettings
from processing.runs.errors import PipelineError
from processing.runs.results_file import FrameName
from processing.runs.seen_views import grey_values
from processing.runs.workbench import References, read_references


def frame_names(run: RunReader) -> tuple[FrameName, ...]:
    """Exposures of every shot of a run."""
    return ("a", "b") if run.header.frames_per_shot == 2 else ("a",)


def require_match(run_name: str, shot: Shot, calibration: Calibration) -> None:
    """Refuse a shot that is not whole, and a calibration that is not made for it or not good enough."""
    if not shot.valid:
        raise PipelineError(f"{run_name}, shot {shot.index}: exposures are missing, nothing to reconstruct")
    calibration.require_usable(shot.views)
    for name, exposures in shot.views.items():
        (rows, columns), (width, height) = exposures.frame_a.shape, calibration.views[name].mapping.image_size_px
        if (columns, rows) != (width, height):
            size = f"image of {columns} x {rows} px, calibrated for {width} x {height} px"
            raise PipelineError(f"{run_name}, {name}: {size}")


def shot_intensities(
    run: RunReader,
    shot: Shot,
    frame: FrameName,
    settings: ReconstructionSettings,
    out: Sequence[Intensity | None] | None = None,
    *,
    references: References | None = None,
    threads: int = DEFAULT_THREADS,
) -> list[Intensity]:
    """Preprocessed images of one exposure.

    Parameters
    ----------
    run : RunReader
        Has polarity and reference images.
    shot : Shot
        A shot of that run.
    frame : {"a", "b"}
        Which exposure.
    settings : ReconstructionSettings
        Sliding minimum and noise floor.
    out : sequence of (rows, columns) float32 arrays, optional
        Receive the images.
    references : mapping, optional
        Those of the run, where somebody has read them already.
    threads : int
        The images do not depend on it.

    Returns
    -------
    list of (rows, columns) float32 arrays
        In the order of the shot's views: 0 where the view is free, 1 where it is blocked.

    Raises
    ------
    PipelineError
        A view has no such exposure.
    """
    header, number = run.header, "ab".index(frame)
    references = read_references(run) if references is None else references
    preprocessing = settings.preprocessing(header.polarity)
    images = []
    for view, image in zip(shot.views, out or [None] * len(shot.views), strict=True):
        dark, background = references[view]
        images.append(
            intensity(
                grey_values(shot, view, frame),
                preprocessing,
                bits=header.views[view].bits,
                dark=None if dark is None else dark[number],
                background=None if background is None else background[number],
                out=image,
                threads=threads,
            )
        )
    return images
