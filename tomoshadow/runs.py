"""Runs on the disk, shot by shot."""

from pathlib import Path
from typing import Literal

from daq.files.run_directory import RunReader
from processing.count import require_count
from processing.preprocessing import Intensity, Preprocessing
from processing.reconstruction.settings import ReconstructionSettings
from processing.runs.shots import shot_images


def read_run(path: str | Path) -> RunReader:
    """Open a run for reading, recorded or imported, also while it is being recorded.

    Of one that was packed into one file there are header, references and outcome: read its frames with h5py.

    Parameters
    ----------
    path : path
        The run directory.

    Returns
    -------
    RunReader
        ``header``, ``shot_count``, ``read_shot(index)``, ``dark(view)``, ``background(view)``, ``outcome``. It holds no
        file open.

    Raises
    ------
    ShotFileError
        A file is missing, torn or damaged; names it.
    """
    run = RunReader(Path(path))
    _ = run.header
    return run


def shot_intensities(
    run: RunReader,
    shot: int,
    frame: Literal["a", "b"] = "a",
    *,
    minimum_window_px: int = Preprocessing.minimum_window_px,
    noise_floor: float = Preprocessing.noise_floor,
) -> dict[str, Intensity]:
    """Intensities of one exposure of a run, by view, with its polarity, dark and background; see ``intensity``.

    Parameters
    ----------
    run : RunReader
        See ``read_run``.
    shot : int
        Index of the shot.
    frame : {"a", "b"}
        Which exposure.
    minimum_window_px, noise_floor
        As for ``intensity``.

    Returns
    -------
    dict of view to (rows, columns) float32 array

    Raises
    ------
    PipelineError
        A view has no such exposure.
    ValueError
        A number is no whole number.
    ShotFileError
        The shot is missing or damaged.
    """
    require_count("minimum_window_px", minimum_window_px)
    recorded = run.read_shot(require_count("shot", shot))
    settings = ReconstructionSettings(minimum_window_px=minimum_window_px, noise_floor=noise_floor)
    images = shot_images.shot_intensities(run, recorded, frame, settings)
    return dict(zip(recorded.views, images, strict=True))
