"""LiveVolume: the newest complete shot of a live view as a volume at half resolution, by MLOS, while somebody looks.

Slices are made from the images when they are asked for, in milliseconds; no volume is kept. A shot of the paper's rig
takes 0.15 s of one processor, its iso-surface 0.25 s more. It never waits for anything, nor makes others wait: who
asks while it is busy gets what there is, and it stops when the live view does.
"""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from threading import Lock
from typing import Annotated

import numpy as np
from pydantic import Field

from daq.devices import Camera
from daq.frozen_model import FrozenModel
from daq.run.refusals import REMEDIES, RefusalCode
from daq.run.state import RunState
from daq.shot import Shot
from processing.calibration.calibration import Calibration
from processing.calibration.calibration_file import load_calibration
from processing.errors import BadInput
from processing.preprocessing import Intensity, intensity
from processing.reconstruction.choices import ReconstructionMethod
from processing.reconstruction.line_of_sight import volume_seen
from processing.reconstruction.planning.calibrated_plan import default_grid, plan_of
from processing.reconstruction.planning.plan import Plan
from processing.reconstruction.seen_exposure import SeenExposure
from processing.reconstruction.settings import GridSettings, ReconstructionSettings
from processing.reconstruction.slab_volume import SLAB_ROWS
from processing.reconstruction.volume_part import Part
from processing.runs.shots.shot_images import require_match
from processing.runs.workbench import Latest
from processing.volume import VoxelGrid
from server.lab.calibrations import CalibrationStore
from server.lab.errors import NotFound
from server.pictures.pictures import plane_png
from server.pictures.previews import AXES, VolumePreview, preview_of_slabs

_METHOD = ReconstructionMethod.MLOS
_LIMIT = 1.0
"""Intensity that is shown brightest: what all views see as blocked."""
_CALIBRATE = "calibrate, or choose a calibration, on the page Calibrate"


class LiveVolumeView(FrozenModel):
    """What there is of the live volume."""

    number: Annotated[int, Field(description="grows with every volume; 0: there is none yet")] = 0
    shot: Annotated[int | None, Field(description="which shot of the live view it shows")] = None
    age_s: Annotated[float | None, Field(description="since that was fired")] = None
    calibration: Annotated[str | None, Field(description="that it is made by")] = None
    shape: Annotated[tuple[int, int, int] | None, Field(description="voxels along z, y, x")] = None
    origin_mm: Annotated[tuple[float, float, float] | None, Field(description="of the first voxel, x, y, z")] = None
    pitch_mm: Annotated[float | None, Field(description="voxel edge: two pixels")] = None
    took_s: Annotated[float | None, Field(description="time that it took to make")] = None
    problem: Annotated[str | None, Field(description="why there is no newer one")] = None
    remedy: Annotated[str | None, Field(description="what to do about that")] = None


@dataclass(frozen=True, eq=False)
class _Seen:
    """One shot as its views see it."""

    number: int
    shot: Shot
    calibration: str
    exposure: SeenExposure
    took_s: float


class _Obstacle(Exception):
    """Why there is no newer volume, and what to do about it."""

    def __init__(self, problem: str, remedy: str) -> None:
        super().__init__(problem)
        self.remedy = remedy


class LiveVolume:
    """Makes the newest volume, one at a time, in the thread of whoever asks.

    Parameters
    ----------
    cameras : Mapping[str, Camera]
        Know the bits of their images.
    calibrations : CalibrationStore
        The current one is used.
    newest_shot : Callable[[], Shot | None]
        Asked for the newest shot.
    state : Callable[[], RunState]
        Nothing is made but in LIVE.
    settings : ReconstructionSettings
        How shots become intensities.
    """

    def __init__(
        self,
        cameras: Mapping[str, Camera],
        calibrations: CalibrationStore,
        newest_shot: Callable[[], Shot | None],
        state: Callable[[], RunState],
        settings: ReconstructionSettings,
    ) -> None:
        self._cameras = cameras
        self._calibrations = calibrations
        self._newest_shot = newest_shot
        self._state = state
        self._settings = settings
        self._busy = Lock()
        self._known: Latest[tuple[Calibration, Plan]] = Latest()
        self._seen: _Seen | None = None

    def look(self) -> LiveVolumeView:
        """Make the volume of the newest shot, unless that is done or somebody does; what there is then."""
        if not self._busy.acquire(blocking=False):
            return self._view(None)
        try:
            self._see_newest()
        except _Obstacle as obstacle:
            return self._view(obstacle)
        except BadInput as error:
            return self._view(_Obstacle(str(error), REMEDIES[RefusalCode.CALIBRATION_SIZE]))
        finally:
            self._busy.release()
        return self._view(None)

    @property
    def view(self) -> LiveVolumeView:
        """What there is; nothing is made."""
        return self._view(None)

    def slice_png(self, axis: str, index: int) -> bytes:
        """A slice across an axis as it is now; y goes down in those across x and z, z in the one across y.

        Raises
        ------
        NotFound
            There is no volume yet, or it has no such plane; the text names the limit.
        """
        exposure, number = self._require().exposure, AXES.index(axis)
        planes = exposure.plan.grid.shape[number]
        if index >= planes:
            raise NotFound(f"{axis} = {index}: the live volume has planes 0 to {planes - 1}")
        part = Part.plane(exposure.plan.grid, number, index)
        plane = exposure.part(part, _METHOD, threads=1).squeeze(number)
        return plane_png(plane.T if axis == "x" else plane, _LIMIT)

    def preview(self) -> VolumePreview:
        """The volume in short, for its iso-surface; NotFound where there is none."""
        exposure = self._require().exposure
        grid = exposure.plan.grid
        nz, ny, nx = grid.shape
        memory = np.empty((nz, min(SLAB_ROWS, ny), nx), np.float16)
        volume, _ = volume_seen(exposure.plan, exposure.images, _METHOD, memory, threads=1)
        return preview_of_slabs(volume.slabs, grid, volume.unit)

    def _require(self) -> _Seen:
        if self._seen is None:
            raise NotFound("there is no live volume yet")
        return self._seen

    def _see_newest(self) -> None:
        self._require_live()
        shot, name = self._newest_shot(), self._calibrations.current
        if name is None:
            raise _Obstacle("there is no calibration, so nobody knows where the views look", _CALIBRATE)
        if shot is None:
            raise _Obstacle("waiting for the first shot", "wait")
        if not shot.valid:
            raise _Obstacle(f"shot {shot.index} is incomplete", "look at the tiles: which view lacks an exposure")
        if self._seen is not None and self._seen.shot is shot and self._seen.calibration == name:
            return
        began_s, path = time.perf_counter(), self._calibrations.path(name)
        key = (name, path.stat().st_mtime_ns if path.is_file() else 0)
        calibration, plan = self._known.of(key, lambda: _planned(load_calibration(path), self._settings, shot))
        require_match("live view", shot, calibration)
        exposure = SeenExposure.of(plan, [self._intensity(shot, view) for view in plan.names], threads=1)
        number = 1 if self._seen is None else self._seen.number + 1
        self._seen = _Seen(number, shot, name, exposure, time.perf_counter() - began_s)

    def _intensity(self, shot: Shot, view: str) -> Intensity:
        self._require_live()
        preprocessing, bits = self._settings.preprocessing("shadow"), self._cameras[view].bits
        return intensity(shot.views[view].frame_a, preprocessing, bits=bits, threads=1)

    def _require_live(self) -> None:
        """A recording needs the processor more."""
        if self._state() is not RunState.LIVE:
            raise _Obstacle("volumes are made while the rig is shown live", "press Live")

    def _view(self, obstacle: _Obstacle | None) -> LiveVolumeView:
        told = {"problem": str(obstacle), "remedy": obstacle.remedy} if obstacle else {}
        if self._seen is None:
            return LiveVolumeView.model_validate(told)
        seen, grid = self._seen, self._seen.exposure.plan.grid
        return LiveVolumeView.model_validate(
            {
                "number": seen.number,
                "shot": seen.shot.index,
                "age_s": round((time.time_ns() - seen.shot.host_time_ns) / 1e9, 2),
                "calibration": seen.calibration,
                "shape": grid.shape,
                "origin_mm": grid.origin_mm,
                "pitch_mm": grid.pitch_mm,
                "took_s": round(seen.took_s, 3),
                **told,
            }
        )


def half_of(grid: VoxelGrid) -> VoxelGrid:
    """A grid of voxels twice as large that fills the same box; each has the middle of eight."""
    nz, ny, nx = ((count + 1) // 2 for count in grid.shape)
    x_mm, y_mm, z_mm = (origin_mm + grid.pitch_mm / 2 for origin_mm in grid.origin_mm)
    return VoxelGrid((nz, ny, nx), (x_mm, y_mm, z_mm), 2 * grid.pitch_mm)


def _planned(calibration: Calibration, settings: ReconstructionSettings, shot: Shot) -> tuple[Calibration, Plan]:
    require_match("live view", shot, calibration)
    whole = settings.grid.to_grid() if settings.grid else default_grid(calibration)
    half = settings.model_copy(update={"grid": GridSettings.of(half_of(whole))})
    return calibration, plan_of(calibration, half, tuple(shot.views))
