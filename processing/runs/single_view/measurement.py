"""Exposures of one view -> droplets in pixels on disk."""

import json
import time
from collections.abc import Iterator, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from processing.analysis.droplets.droplet_file import FRAME, StoredDroplets, write_columns
from processing.analysis.droplets.size_statistics import mean_diameters
from processing.analysis.flat.darkness import LightError
from processing.analysis.flat.flat_doubts import chosen_by_size, crowded, flat_doubts, no_discs
from processing.analysis.flat.flat_droplets import FlatDroplets, measure_flat
from processing.analysis.flat.flat_settings import FlatSettings
from processing.analysis.flat.repeated import Discs, counted_twice
from processing.errors import BadInput
from processing.image_file import ImageFileError
from processing.reconstruction.settings import FrozenValue
from processing.runs.recipe import recipe_sha256
from processing.runs.results_file import Provenance, claim_results
from processing.runs.single_view.sources import Exposure, FlatSource

COMMAND, METHOD_VERSION = "measure-single-view", 3

Verdict = Literal["good", "doubtful", "empty", "refused"]
WORST: tuple[Verdict, ...] = ("refused", "doubtful", "good", "empty")
"""Of the exposures of a shot the first one of these is that of the shot."""


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
    """Mean diameters of images or shots, in the unit of their columns: keys end with ``_px`` or ``_um``.

    Each droplet counts as often as its border leaves out others of its size.
    """
    unit = "um" if any("diameter_um" in shot.columns for shot in shots) else "px"
    diameters = [np.asarray(shot.columns[f"diameter_{unit}"], np.float64) for shot in shots]
    exposures = [len(shot.exposures) for shot in shots]
    weights = [1 / np.asarray(shot.columns["whole_share"], np.float64) for shot in shots]
    per_shot = sum(exposures) / max(len(exposures), 1)
    sizes = mean_diameters(diameters, exposures_per_shot=per_shot, weights_by_shot=weights)
    told = sizes.model_dump(mode="json")
    return {f"{name[:-3]}_{unit}" if name.endswith("_um") else name: value for name, value in told.items()}


def unlike_image_sizes(images: Mapping[str, StoredDroplets]) -> tuple[str, ...]:
    """Why images by name have no common scale: they are not as large."""
    first: dict[tuple[int, int], str] = {}
    for name, image in images.items():
        for one in image.exposures.values():
            if size_px := one.get("image_size_px"):
                first.setdefault(tuple(size_px), name)
    if len(first) < 2:
        return ()
    sizes = ", ".join(f"{name}: {columns} x {rows} px" for (columns, rows), name in first.items())
    return (
        f"images have {len(first)} sizes ({sizes}): are they of one camera, at one magnification, and is a pixel as "
        "wide in all of them? Means are of no spray where it is not; measure those of each size by themselves",
    )


def doubts_together(shots: Sequence[StoredDroplets], um_per_px: float | None) -> tuple[str, ...]:
    """Why shots together are doubted, of which each may have too few shadows to say it.

    Parameters
    ----------
    shots : sequence of StoredDroplets
        Of one measurement.
    um_per_px : float | None
        Width of a pixel, where columns are in um.
    """
    unit, scale = ("px", 1.0) if um_per_px is None else ("um", um_per_px)
    told = [one for shot in shots for one in shot.exposures.values()]
    overlapping = sum(int(np.count_nonzero(shot.columns["overlapping"])) for shot in shots)
    clumps = sum(one["left_out"].get("not_round", 0) for one in told)
    sizes_px = (
        np.concatenate([np.empty(0), *(np.asarray(one.columns[f"diameter_{unit}"], float) for one in shots)]) / scale
    )
    lacking_px = np.array([size for one in told for size in one.get("lacking_px", ())], np.float64)
    residuals = np.concatenate([np.empty(0), *(np.asarray(shot.columns["edge_residual"], float) for shot in shots)])
    doubts = (crowded(overlapping, clumps, len(sizes_px)), chosen_by_size(sizes_px, lacking_px), no_discs(residuals))
    return tuple(doubt for doubt in doubts if doubt)


def droplets_twice(images: Mapping[str, StoredDroplets], um_per_px: float | None) -> tuple[str, ...]:
    """What is counted more than once in images by name, in their order: other exposures, frames of a film, dust."""
    return counted_twice({name: _discs(image, um_per_px) for name, image in images.items()})


def _discs(image: StoredDroplets, um_per_px: float | None) -> Discs:
    """Centres and diameters of the first exposure, in px."""
    unit, scale = ("px", 1.0) if um_per_px is None else ("um", um_per_px)
    first = image.columns[FRAME] == "a"
    x, y, diameter = (image.columns[f"{name}_{unit}"][first] / scale for name in ("x", "y", "diameter"))
    return np.column_stack([x, y]), np.asarray(diameter, np.float64)


def _found(source: FlatSource, settings: FlatSettings) -> Mapping[str, FlatDroplets | BadInput]:
    """Droplets by exposure, or why there are none: an image that cannot be read stops no other."""
    try:
        exposures = source.exposures()
    except ImageFileError as error:
        return {"a": error}
    return {frame: _measured(exposure, settings) for frame, exposure in exposures.items()}


def _measured(exposure: Exposure, settings: FlatSettings) -> FlatDroplets | LightError:
    image, light, saturated = exposure
    try:
        return measure_flat(image, settings, light, saturated)
    except LightError as error:
        return error


def _told(found: FlatDroplets | BadInput) -> dict[str, Any]:
    unmeasured = {"residual_over_noise": None}
    if isinstance(found, BadInput):
        return {"verdict": "refused", "reasons": [str(found)], "droplets": 0, "left_out": {}, **unmeasured}
    doubts = flat_doubts(found)
    verdict = "empty" if not len(found) else "doubtful" if doubts else "good"
    told = {"droplets": len(found), "left_out": found.left_out, "image_size_px": found.image_size_px}
    lacking_px = [round(size_px, 2) for size_px in found.lacking_px.tolist()]
    return {"verdict": verdict, "reasons": doubts, **told, "lacking_px": lacking_px, **unmeasured}


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
