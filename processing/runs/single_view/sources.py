"""Exposures of one view, from image files or the shots of a run."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from daq.files.run_directory import RunReader
from processing.analysis.flat.darkness import FULL_SCALES
from processing.calibration.calibration_file import file_sha256
from processing.image_file import GreyImage, read_image
from processing.light import FULL, LEAST_FULL, piles_up
from processing.preprocessing import Frame, Intensity
from processing.runs.errors import PipelineError
from processing.runs.results_file import Provenance
from processing.runs.seen_views import grey_values
from processing.runs.shots.shot_images import frame_names
from processing.runs.workbench import read_references

Grey = NDArray[np.generic]
Exposure = tuple[Grey, Grey | None, NDArray[np.bool_] | None]
"""An image less its dark image; the light without droplets, if that is known; its pixels at full scale, likewise."""


@dataclass(frozen=True, eq=False)
class FlatSource:
    """An image, or a shot of one view.

    Parameters
    ----------
    name : str
        Of the image, without its ending, or ``shot_00012``.
    shot : int | None
        Index, if it is a shot.
    exposures : callable
        Reads them, by frame.
    """

    name: str
    shot: int | None
    exposures: Callable[[], Mapping[str, Exposure]]

    def droplets_path(self, results_dir: Path) -> Path:
        """Where its droplets lie."""
        return results_dir / f"{self.name}_droplets.h5"


def image_sources(paths: Sequence[Path], background: Path | None = None) -> list[FlatSource]:
    """Images from elsewhere.

    Raises
    ------
    PipelineError
        One of them or the background is not there, two differ in their ending alone, or one is a copy of another.
    """
    if absent := [path for path in [*paths, *([background] if background else [])] if not path.is_file()]:
        raise PipelineError(f"{absent[0]}: there is no such image or run")
    names = [path.stem for path in paths]
    if twice := {name for name in names if names.count(name) > 1}:
        raise PipelineError(f"two images are called {min(twice)}: their droplets would share a file")
    _require_different(paths)
    return [FlatSource(path.stem, None, partial(_of_image, path, background)) for path in paths]


def _require_different(paths: Sequence[Path]) -> None:
    """Droplets of a copy would count twice, and make the sizes surer than they are."""
    sizes = Counter(path.stat().st_size for path in paths)
    first: dict[str, Path] = {}
    for path in (path for path in paths if sizes[path.stat().st_size] > 1):
        if (other := first.setdefault(file_sha256(path), path)) is not path:
            raise PipelineError(f"{path}: the same image as {other.name}; its droplets would count twice")


def image_origin(paths: Sequence[Path], background: Path | None) -> Provenance:
    """Where images and their light come from: only those of one folder and one light belong together."""
    told: Provenance = {"images": ", ".join(sorted({str(path.resolve().parent) for path in paths}))}
    if background is None:
        return told
    return {**told, "background": background.name, "background_sha256": file_sha256(background)}


def shot_sources(run: RunReader, view: str | None, shots: Sequence[int]) -> list[FlatSource]:
    """Shots of one view of a run, which stays open.

    Raises
    ------
    PipelineError
        The run has several views and none was named, or not that one.
    """
    chosen = _view(run, view)
    references = read_references(run)[chosen]
    most = FULL * (2 ** run.header.views[chosen].bits - 1)

    def exposures(index: int) -> Mapping[str, Exposure]:
        shot = run.read_shot(index)
        if not shot.valid:
            raise PipelineError(f"{run.run_dir.name}, shot {index}: exposures are missing, nothing to measure")
        return {
            frame: _less_dark(
                grey_values(shot, chosen, frame),
                most,
                *(None if reference is None else reference["ab".index(frame)] for reference in references),
            )
            for frame in frame_names(run)
        }

    return [FlatSource(f"shot_{index:05d}", index, partial(exposures, index)) for index in shots]


def _less_dark(grey: Frame, most: float, dark: Intensity | None, light: Intensity | None) -> Exposure:
    saturated = grey > most if light is None else (grey > most) | (light > most)
    if dark is None:
        return grey, light, saturated
    return grey.astype(np.float32) - dark, None if light is None else light - dark, saturated


def _view(run: RunReader, view: str | None) -> str:
    names = list(run.header.views)
    if view is None and len(names) > 1:
        raise PipelineError(
            f"{run.run_dir.name}: has views {', '.join(names)}: --calibration says where they are; without it, --view "
            "NAME measures one of them by itself"
        )
    if view is not None and view not in names:
        raise PipelineError(f"{run.run_dir.name}: has no view {view!r}, it has {', '.join(names)}")
    return view or names[0]


def _of_image(path: Path, background: Path | None) -> Mapping[str, Exposure]:
    grey, light = read_image(path), None if background is None else read_image(background)
    if light is not None and light.shape != grey.shape:
        raise PipelineError(f"{background}: has shape {light.shape}, {path.name} has {grey.shape}")
    saturated = _full(grey) if light is None else _full(grey) | _full(light)
    return {"a": (grey.astype(np.float32), None if light is None else light.astype(np.float32), saturated)}


def _full(grey: GreyImage) -> NDArray[np.bool_]:
    """Pixels at the end of the camera's scale, or where they pile up not far below that of 8 to 16 bits."""
    highest = int(grey.max(initial=0))
    scale = next(most for most in sorted(FULL_SCALES) if most >= highest)
    at_end = highest == scale or (highest >= LEAST_FULL * scale and piles_up(grey))
    return grey == highest if at_end else np.zeros(grey.shape, np.bool_)
