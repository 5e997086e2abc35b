"""Calibration sets from recorded runs: the target at known positions of the stage."""

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import lru_cache, partial
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from daq.files.run_directory import ImageKey, RunReader, Shot
from processing.calibration.errors import CalibrationError
from processing.calibration.observation import CalibrationSet
from processing.calibration.sets.plane_detection import PlaneImage, detect_planes
from processing.calibration.target.targets import Target
from processing.optics import image_scale_px_per_mm
from processing.progress import Counted, in_silence

Place = tuple[str, float]
"""A view, and a position of the stage in mm."""
Origins = Mapping[Place, tuple[float, float]]
"""Where the target's origin is seen (u, v)."""
Rolls = Mapping[str, float]
"""How cameras are turned about their axes, in degrees."""
Positions = Mapping[float, list[int]]
"""Indices of shots by stage position in mm."""
MeanFrames = dict[str, NDArray[np.float32]]
"""Mean of exposures A by view, (rows, columns)."""

NO_ORIGINS: Origins = MappingProxyType({})
NO_ROLLS: Rolls = MappingProxyType({})

_SHOWS_TARGET = (ImageKey.SAMPLE, ImageKey.FLAT)


def detect_recorded(
    run_dir: Path,
    origins: Origins = NO_ORIGINS,
    rolls_deg: Rolls = NO_ROLLS,
    mirrored: Sequence[str] = (),
    counted: Counted = in_silence,
) -> CalibrationSet:
    """Detect the target in exposures A, averaged over the valid shots of each stage position.

    What single images do not tell, see ``plane_detection.detect_planes``.

    Parameters
    ----------
    run_dir : Path
        A calibration run.
    origins : mapping of (view, z_mm) to (u, v)
        Where the target's origin is seen, roughly.
    rolls_deg : mapping of view to angle
        How cameras are turned about their axes, 180 where one hangs upside down; else as the run's configuration says.
        Where a view that is named here stands is not checked against the configuration.
    mirrored : sequence of str
        Views that look by a mirror.
    counted : Counted
        Told of the images, one by one.

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
        configuration, views = run.header.configuration, list(run.header.views)
        _check_origins(run_dir, origins, views, list(positions))
        _check_views(run_dir, "a roll", rolls_deg, views)
        _check_views(run_dir, "a mirror", mirrored, views)
        believed_deg = {**_of_views(configuration, "roll_deg"), **rolls_deg}
        images = _plane_images(run, positions, origins)
        detected = detect_planes(str(run_dir), images, target, believed_deg, mirrored, counted)
        source = run.header.run_id
    azimuths_deg = _of_views(configuration, "azimuth_deg")
    checked_deg = {name: azimuths_deg[name] for name in views if name in azimuths_deg and name not in rolls_deg}
    return CalibrationSet(
        source,
        target,
        detected.views,
        detected.notes,
        azimuths_deg=checked_deg,
        rolls_deg=believed_deg,
        mirrored=tuple(mirrored),
        scales_px_per_mm=nominal_scales(configuration),
        unit_stated=True,
    )


def _plane_images(run: RunReader, positions: Positions, origins: Origins) -> list[PlaneImage]:
    """Every view at every position, the mean of its frames; those of one position are read together."""
    mean_frames = lru_cache(maxsize=1)(lambda z_mm: _mean_frames(run, positions[z_mm]))
    return [
        PlaneImage(
            view,
            f"z={z_mm:g}",
            f"z {z_mm:g} mm",
            z_mm,
            partial(_frame_of, mean_frames, z_mm, view),
            origins.get((view, z_mm)),
        )
        for z_mm in positions
        for view in run.header.views
    ]


def _frame_of(mean_frames: Callable[[float], MeanFrames], z_mm: float, view: str) -> NDArray[np.float32]:
    return mean_frames(z_mm)[view]


def _check_origins(run_dir: Path, origins: Origins, views: Sequence[str], positions_mm: Sequence[float]) -> None:
    for view, z_mm in origins:
        if view not in views or z_mm not in positions_mm:
            raise CalibrationError(
                f"{run_dir}: an origin is stated for {view} at z {z_mm:g} mm; views are {', '.join(views)}, "
                f"positions {', '.join(f'{one_mm:g}' for one_mm in positions_mm)} mm"
            )


def _check_views(run_dir: Path, what: str, stated: Iterable[str], views: Sequence[str]) -> None:
    if strangers := sorted(set(stated).difference(views)):
        raise CalibrationError(f"{run_dir}: {what} is stated for {', '.join(strangers)}; views are {', '.join(views)}")


def _of_views(configuration: dict[str, Any], key: str) -> dict[str, float]:
    """A number of every view that the rig's configuration has; runs from elsewhere may not say."""
    views = configuration.get("views", {})
    return {name: float(view[key]) for name, view in views.items() if key in view}


def nominal_scales(configuration: dict[str, Any]) -> dict[str, float]:
    """Scale of every view by magnification and pixels; runs from elsewhere may not say."""
    return {
        name: image_scale_px_per_mm(view["lens"]["magnification"], view["sensor"]["pixel_pitch_um"])
        for name, view in configuration.get("views", {}).items()
        if "lens" in view and "sensor" in view
    }


def mean_target_images(run_dir: Path, z_mm: float) -> MeanFrames:
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


def _mean_frames(run: RunReader, shots: list[int]) -> MeanFrames:
    totals: MeanFrames = {}
    for index in shots:
        shot: Shot = run.read_shot(index)
        for view, exposures in shot.views.items():
            frame = exposures.frame_a.astype(np.float32)
            totals[view] = totals[view] + frame if view in totals else frame
    return {view: total / np.float32(len(shots)) for view, total in totals.items()}
