"""Calibration sets from recorded runs: the target at known positions of the stage."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from daq.shotfile import ImageKey, RunReader, Shot
from processing.calibration.errors import CalibrationError, OriginUnknown, TargetNotFound
from processing.calibration.imported_set import place_points
from processing.calibration.observation import CalibrationSet, PlaneObservation, ViewObservations
from processing.calibration.partial_views import detect_by_others
from processing.calibration.targets import Target, detect_target

Place = tuple[str, float]
"""A view, and a position of the stage in mm."""
Origins = Mapping[Place, tuple[float, float]]
"""Where the target's origin is seen (u, v)."""
Rolls = Mapping[str, float]
"""How cameras are turned about their axes, in degrees."""
Found = dict[Place, PlaneObservation]
Positions = Mapping[float, list[int]]
"""Indices of shots by stage position in mm."""

NO_ORIGINS: Origins = MappingProxyType({})
NO_ROLLS: Rolls = MappingProxyType({})

_SHOWS_TARGET = (ImageKey.SAMPLE, ImageKey.FLAT)


def detect_recorded(run_dir: Path, origins: Origins = NO_ORIGINS, rolls_deg: Rolls = NO_ROLLS) -> CalibrationSet:
    """Detect the target in exposures A, averaged over the valid shots of each stage position.

    Where a view sees a part of the target only, the positions at which it is told which points these are (the whole
    board, a marker, a stated origin) tell it for the others. A view that does not see the target at some position
    goes without it; the set notes both.

    Parameters
    ----------
    run_dir : Path
        A calibration run.
    origins : mapping of (view, z_mm) to (u, v)
        Where the target's origin is seen, roughly.
    rolls_deg : mapping of view to angle
        How cameras are turned about their axes, 180 where one hangs upside down; else as the run's configuration says.
        Where a view that is named here stands is not checked against the configuration.

    Raises
    ------
    CalibrationError
        The run does not say what its target is, has no stage positions, a view never sees the target, or an origin
        or a roll is stated for a view or a position that the run does not have.
    """
    with RunReader(run_dir) as run:
        target = _target(run_dir, run.header.configuration)
        positions = dict(sorted(_by_position(run).items()))
        if not positions:
            raise CalibrationError(f"{run_dir}: no valid shot has a stage position; is it a calibration run?")
        views, sizes = list(run.header.views), {name: form.shape[::-1] for name, form in run.header.views.items()}
        _check_origins(run_dir, origins, views, list(positions))
        _check_rolls(run_dir, rolls_deg, views)
        configuration = run.header.configuration
        believed_deg = {**_of_views(configuration, "roll_deg"), **rolls_deg}
        found, missed = _first_look(run, target, positions, origins, believed_deg)
        more, notes = _second_look(run, target, positions, found, missed, believed_deg)
        source = run.header.run_id
    points = found | more
    planes = {view: [points[place] for place in sorted(points) if place[0] == view] for view in views}
    _check_seen(run_dir, planes, notes)
    seen = {view: ViewObservations(sizes[view], tuple(planes[view])) for view in views}
    azimuths_deg = _of_views(configuration, "azimuth_deg")
    checked_deg = {name: azimuths_deg[name] for name in views if name in azimuths_deg and name not in rolls_deg}
    return CalibrationSet(source, target, seen, tuple(notes), checked_deg, believed_deg)


def _first_look(
    run: RunReader, target: Target, positions: Positions, origins: Origins, rolls_deg: Rolls
) -> tuple[Found, dict[Place, TargetNotFound]]:
    """What each image tells by itself, and why the others do not."""
    found, missed = {}, {}
    for z_mm, shots in positions.items():
        for view, image in _mean_frames(run, shots).items():
            try:
                points = detect_target(image, target, origins.get((view, z_mm)), rolls_deg.get(view, 0.0))
                found[view, z_mm] = place_points(points, target, f"z={z_mm:g}", z_mm)
            except TargetNotFound as error:
                missed[view, z_mm] = error
    return found, missed


def _second_look(
    run: RunReader,
    target: Target,
    positions: Positions,
    found: Found,
    missed: Mapping[Place, TargetNotFound],
    rolls_deg: Rolls,
) -> tuple[Found, list[str]]:
    """What the other positions of a view tell of images that show a part of the target; notes on all of these."""
    more, notes = {}, []
    for (view, z_mm), reason in missed.items():
        known = [plane for (name, _), plane in found.items() if name == view]
        try:
            if not isinstance(reason, OriginUnknown):
                raise reason
            image = _mean_frames(run, positions[z_mm])[view]
            points = detect_by_others(image, target, z_mm, known, rolls_deg.get(view, 0.0))
        except TargetNotFound as error:
            also = "" if error is reason else f"; {error}"
            notes.append(f"{view}, z {z_mm:g} mm left out: {reason}{also}")
            continue
        more[view, z_mm] = place_points(points, target, f"z={z_mm:g}", z_mm)
        notes.append(f"{view}, z {z_mm:g} mm: {len(points)} points of the target; other positions tell which")
    return more, notes


def _check_origins(run_dir: Path, origins: Origins, views: Sequence[str], positions_mm: Sequence[float]) -> None:
    for view, z_mm in origins:
        if view not in views or z_mm not in positions_mm:
            raise CalibrationError(
                f"{run_dir}: an origin is stated for {view} at z {z_mm:g} mm; views are {', '.join(views)}, "
                f"positions {', '.join(f'{one_mm:g}' for one_mm in positions_mm)} mm"
            )


def _check_rolls(run_dir: Path, rolls_deg: Rolls, views: Sequence[str]) -> None:
    if strangers := sorted(set(rolls_deg).difference(views)):
        raise CalibrationError(f"{run_dir}: a roll is stated for {', '.join(strangers)}; views are {', '.join(views)}")


def _of_views(configuration: dict[str, Any], key: str) -> dict[str, float]:
    """A number of every view that the rig's configuration has; runs from elsewhere may not say."""
    views = configuration.get("views", {})
    return {name: float(view[key]) for name, view in views.items() if key in view}


def mean_target_images(run_dir: Path, z_mm: float) -> dict[str, NDArray[np.float32]]:
    """Exposures A of every view, averaged over the valid shots at one stage position."""
    with RunReader(run_dir) as run:
        return _mean_frames(run, _by_position(run)[z_mm])


def _target(run_dir: Path, configuration: dict[str, Any]) -> Target:
    if "target" not in configuration:
        raise CalibrationError(f"{run_dir}: configuration.target: the run does not say what its target is")
    try:
        return Target.model_validate(configuration["target"])
    except ValidationError as error:
        raise CalibrationError(f"{run_dir}: configuration.target: {error.errors()[0]['msg']}") from error


def _by_position(run: RunReader) -> Positions:
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


def _check_seen(run_dir: Path, planes: Mapping[str, Sequence[PlaneObservation]], notes: Sequence[str]) -> None:
    for view, seen in planes.items():
        if not seen:
            reason = next(note for note in notes if note.startswith(view))
            raise CalibrationError(f"{run_dir}: {view} never sees the target; {reason}")
