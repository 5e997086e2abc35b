"""Exposures of one view -> droplets in pixels on disk; an image file, or a shot of a run."""

import json
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from daq.files.run_directory import RunReader
from processing.analysis.droplets.droplet_file import FRAME, StoredDroplets, write_columns
from processing.analysis.droplets.size_statistics import mean_diameters
from processing.analysis.flat.darkness import LightError
from processing.analysis.flat.flat_droplets import FlatDroplets, FlatSettings, measure_flat
from processing.analysis.flat.repeated import Discs, counted_twice
from processing.calibration.calibration_file import file_sha256
from processing.errors import BadInput
from processing.image_file import ImageFileError, read_image
from processing.preprocessing import Intensity
from processing.reconstruction.settings import FrozenValue
from processing.runs.errors import PipelineError
from processing.runs.exposure_faults import grey_values
from processing.runs.recipe import recipe_sha256
from processing.runs.results_file import Provenance, claim_results
from processing.runs.shots.shot_images import frame_names
from processing.runs.workbench import read_references

COMMAND, METHOD_VERSION = "measure-single-view", 1
Grey = NDArray[np.generic]
Exposure = tuple[Grey, Grey | None]
"""An image less its dark image, and the light without droplets, if that is known."""


Verdict = Literal["good", "doubtful", "empty", "refused"]
WORST: tuple[Verdict, ...] = ("refused", "doubtful", "good", "empty")
"""Of the exposures of a shot the first one of these is that of the shot."""
LEAST_MEASURED = 0.5
"""Of the droplets that are seen whole: of fewer, means are those of a choice that size and sharpness have made."""


class FlatShot(FrozenValue):
    """What became of an image, or of the exposures of a shot."""

    image: str
    shot: int | None
    droplets: int
    left_out: Mapping[str, int]
    verdict: Verdict
    reasons: tuple[str, ...]
    cpu_s: float
    file: str


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

    def exposures(index: int) -> Mapping[str, Exposure]:
        shot = run.read_shot(index)
        if not shot.valid:
            raise PipelineError(f"{run.run_dir.name}, shot {index}: exposures are missing, nothing to measure")
        return {
            frame: _less_dark(
                grey_values(shot, chosen, frame),
                *(None if reference is None else reference["ab".index(frame)] for reference in references),
            )
            for frame in frame_names(run)
        }

    return [FlatSource(f"shot_{index:05d}", index, partial(exposures, index)) for index in shots]


def _less_dark(grey: Grey, dark: Intensity | None, light: Intensity | None) -> Exposure:
    if dark is None:
        return grey, light
    return grey.astype(np.float32) - dark, None if light is None else light - dark


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


def measure_source(
    source: FlatSource, settings: FlatSettings, um_per_px: float | None, results_dir: Path, origin: Provenance
) -> FlatShot:
    """Measure the exposures of an image or shot, and write its droplets.

    Parameters
    ----------
    source : FlatSource
        What to measure.
    settings : FlatSettings
        How.
    um_per_px : float | None
        Width of a pixel in the spray: columns end with ``_um`` then, else with ``_px``.
    results_dir : Path
        Receives the droplets.
    origin : Provenance
        Where the images come from: the same for all of a directory.

    Raises
    ------
    PipelineError
        The background is not as large as the image, or an exposure is missing.
    VolumeFileError
        The directory holds results of something else.
    """
    started_cpu_s = time.process_time()
    made_by = {
        **origin,
        "settings": settings.model_dump_json(),
        "um_per_px": um_per_px or 0.0,
        "method_version": METHOD_VERSION,
        "tomoshadow": version("tomoshadow"),
    }
    found = _found(source, settings)
    claim_results(results_dir, made_by)
    told = {frame: _told(one) for frame, one in found.items()}
    named: Provenance = {
        **made_by,
        **({"image": source.name} if source.shot is None else {"shot": source.shot}),
        "recipe_sha256": recipe_sha256(COMMAND, METHOD_VERSION, settings),
        "exposures": json.dumps(told),
    }
    path = source.droplets_path(results_dir)
    write_columns(path, _columns(found, um_per_px), named)
    return _summary(source, told, time.process_time() - started_cpu_s, path)


def flat_statistics(shots: Sequence[StoredDroplets]) -> dict[str, Any]:
    """Mean diameters of images or shots, in the unit of their columns: keys end with ``_px`` or ``_um``."""
    unit = "um" if any("diameter_um" in shot.columns for shot in shots) else "px"
    diameters = [np.asarray(shot.columns[f"diameter_{unit}"], np.float64) for shot in shots]
    exposures = [len(json.loads(str(shot.provenance["exposures"]))) for shot in shots]
    sizes = mean_diameters(diameters, exposures_per_shot=sum(exposures) / max(len(exposures), 1))
    told = sizes.model_dump(mode="json")
    return {f"{name[:-3]}_{unit}" if name.endswith("_um") else name: value for name, value in told.items()}


def droplets_twice(images: Mapping[str, StoredDroplets], um_per_px: float | None) -> tuple[str, ...]:
    """What is counted more than once in images by name, in their order: other exposures, frames of a film, dust."""
    return counted_twice({name: _discs(image, um_per_px) for name, image in images.items()})


def _discs(image: StoredDroplets, um_per_px: float | None) -> Discs:
    """Centres and diameters of the first exposure, in px."""
    unit, scale = ("px", 1.0) if um_per_px is None else ("um", um_per_px)
    first = image.columns[FRAME] == "a"
    x, y, diameter = (image.columns[f"{name}_{unit}"][first] / scale for name in ("x", "y", "diameter"))
    return np.column_stack([x, y]), np.asarray(diameter, np.float64)


def _of_image(path: Path, background: Path | None) -> Mapping[str, Exposure]:
    grey = read_image(path).astype(np.float32)
    if background is None:
        return {"a": (grey, None)}
    light = read_image(background).astype(np.float32)
    if light.shape != grey.shape:
        raise PipelineError(f"{background}: has shape {light.shape}, {path.name} has {grey.shape}")
    return {"a": (grey, light)}


def _found(source: FlatSource, settings: FlatSettings) -> Mapping[str, FlatDroplets | BadInput]:
    """Droplets by exposure, or why there are none: an image that cannot be read stops no other."""
    try:
        exposures = source.exposures()
    except ImageFileError as error:
        return {"a": error}
    return {frame: _measured(exposure, settings) for frame, exposure in exposures.items()}


def _measured(exposure: Exposure, settings: FlatSettings) -> FlatDroplets | LightError:
    image, light = exposure
    try:
        return measure_flat(image, settings, light)
    except LightError as error:
        return error


def _told(found: FlatDroplets | BadInput) -> dict[str, Any]:
    unmeasured = {"residual_over_noise": None}
    if isinstance(found, BadInput):
        return {"verdict": "refused", "reasons": [str(found)], "droplets": 0, "left_out": {}, **unmeasured}
    doubt = _doubt(found)
    verdict = "empty" if not len(found) else "doubtful" if doubt else "good"
    told = {"reasons": [doubt] if doubt else [], "droplets": len(found), "left_out": found.left_out}
    return {"verdict": verdict, **told, **unmeasured}


def _doubt(found: FlatDroplets) -> str | None:
    """Why means are not those of the spray: most of what is seen whole was not measured."""
    lacking = {reason: number for reason, number in found.left_out.items() if reason != "border"}
    seen = len(found) + sum(lacking.values())
    if len(found) >= LEAST_MEASURED * seen:
        return None
    why = ", ".join(f"{number} {reason.replace('_', ' ')}" for reason, number in lacking.items())
    return f"{len(found)} of {seen} shadows are measured ({why}): means are of those, not of the spray"


def _columns(found: Mapping[str, FlatDroplets | BadInput], um_per_px: float | None) -> dict[str, NDArray[np.generic]]:
    seen = {frame: one for frame, one in found.items() if isinstance(one, FlatDroplets)} or {"a": FlatDroplets.none()}
    tables = [one.columns() for one in seen.values()]
    frames = np.concatenate([np.full(len(one), frame, "S1") for frame, one in seen.items()])
    joined = {name: np.concatenate([table[name] for table in tables]) for name in tables[0]}
    return {FRAME: frames} | dict(_scaled(joined, um_per_px))


def _scaled(
    columns: Mapping[str, NDArray[np.generic]], um_per_px: float | None
) -> Iterator[tuple[str, NDArray[np.generic]]]:
    for name, column in columns.items():
        if um_per_px is not None and name.endswith("_px"):
            yield f"{name[:-3]}_um", column.astype(np.float64) * um_per_px
        else:
            yield name, column


def _summary(source: FlatSource, told: Mapping[str, Mapping[str, Any]], cpu_s: float, path: Path) -> FlatShot:
    verdicts = {one["verdict"] for one in told.values()}
    left_out: dict[str, int] = {}
    for one in told.values():
        for reason, number in one["left_out"].items():
            left_out[reason] = left_out.get(reason, 0) + number
    return FlatShot(
        image=source.name,
        shot=source.shot,
        droplets=sum(one["droplets"] for one in told.values()),
        left_out=left_out,
        verdict=next(one for one in WORST if one in verdicts),
        reasons=tuple(dict.fromkeys(reason for one in told.values() for reason in one["reasons"])),
        cpu_s=cpu_s,
        file=path.name,
    )
