"""Calibration sets from recorded runs: the target at known positions of the stage."""

from collections import defaultdict
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from daq.shotfile import ImageKey, RunReader, Shot
from processing.calibration.errors import CalibrationError, TargetNotFound
from processing.calibration.imported_set import place_points
from processing.calibration.observation import CalibrationSet, PlaneObservation, ViewObservations
from processing.calibration.targets import Target, detect_target

_SHOWS_TARGET = (ImageKey.SAMPLE, ImageKey.FLAT)


def detect_recorded(run_dir: Path) -> CalibrationSet:
    """Detect the target in exposures A, averaged over the valid shots of each stage position.

    A view that does not see the target at some position goes without it; the set notes that.

    Raises
    ------
    CalibrationError
        The run does not say what its target is, has no stage positions, or a view never sees the target.
    """
    with RunReader(run_dir) as run:
        target = _target(run_dir, run.header.configuration)
        positions = _by_position(run)
        if not positions:
            raise CalibrationError(f"{run_dir}: no valid shot has a stage position; is it a calibration run?")
        planes: dict[str, list[PlaneObservation]] = {view: [] for view in run.header.views}
        notes = []
        for z_mm, shots in sorted(positions.items()):
            for view, image in _mean_frames(run, shots).items():
                try:
                    points = detect_target(image, target)
                except TargetNotFound as error:
                    notes.append(f"{view}, z {z_mm:g} mm left out: {error}")
                    continue
                planes[view].append(place_points(points, target, f"z={z_mm:g}", z_mm))
        sizes = {view: (form.shape[1], form.shape[0]) for view, form in run.header.views.items()}
        source = run.header.run_id
    _check_seen(run_dir, planes, notes)
    views = {view: ViewObservations(sizes[view], tuple(seen)) for view, seen in planes.items()}
    return CalibrationSet(source, target, views, tuple(notes))


def mean_target_images(run_dir: Path, z_mm: float) -> dict[str, NDArray[np.float32]]:
    """Exposures A of every view, averaged over the valid shots at one stage position."""
    with RunReader(run_dir) as run:
        return _mean_frames(run, _by_position(run)[z_mm])


def _target(run_dir: Path, configuration: dict[str, object]) -> Target:
    if "target" not in configuration:
        raise CalibrationError(f"{run_dir}: configuration.target: the run does not say what its target is")
    try:
        return Target.model_validate(configuration["target"])
    except ValidationError as error:
        raise CalibrationError(f"{run_dir}: configuration.target: {error.errors()[0]['msg']}") from error


def _by_position(run: RunReader) -> dict[float, list[int]]:
    """Indices of valid shots by stage position."""
    positions: dict[float, list[int]] = defaultdict(list)
    for index in np.flatnonzero(np.isin(run.image_keys(), _SHOWS_TARGET)):
        shot = run.read_shot(int(index))
        if shot.valid and shot.stage_z_mm is not None:
            positions[round(shot.stage_z_mm, 6)].append(int(index))
    return positions


def _mean_frames(run: RunReader, shots: list[int]) -> dict[str, NDArray[np.float32]]:
    totals: dict[str, NDArray[np.float32]] = {}
    for index in shots:
        shot: Shot = run.read_shot(index)
        for view, exposures in shot.views.items():
            frame = exposures.frame_a.astype(np.float32)
            totals[view] = totals[view] + frame if view in totals else frame
    return {view: total / np.float32(len(shots)) for view, total in totals.items()}


def _check_seen(run_dir: Path, planes: dict[str, list[PlaneObservation]], notes: list[str]) -> None:
    for view, seen in planes.items():
        if not seen:
            reason = next(note for note in notes if note.startswith(view))
            raise CalibrationError(f"{run_dir}: {view} never sees the target; {reason}")
