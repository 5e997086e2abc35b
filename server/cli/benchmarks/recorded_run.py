"""A run on disk as four cameras record it, and its calibration: what chains are measured with."""

from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path

import numpy as np

from daq.files.run_directory import DoubleFrame, ExposureRecord, ImageKey, RunHeader, RunWriter, Shot, ViewFormat
from processing.benchmarks.scene import RawExposure, SpeedStudy, raw_exposures, spray_images, study_cameras
from processing.calibration.calibration_file import save_calibration
from processing.geometry import PinholeCamera
from processing.reconstruction.settings import GridSettings, ReconstructionSettings
from processing.studies.seen_droplets import droplet_calibration

BITS = 8
_SEEN = ExposureRecord(valid=True, frame_id=1, device_timestamp_ns=1)


@dataclass(frozen=True)
class RecordedRun:
    """Where it lies, how many double exposures it has, and how they are reconstructed."""

    run_dir: Path
    calibration_file: Path
    shots: int
    settings: ReconstructionSettings

    @property
    def grid_option(self) -> str:
        """The grid as commands are told it."""
        grid = self.settings.grid.to_grid() if self.settings.grid else None
        if grid is None:
            raise ValueError("no grid")
        spans = (f"{values[0]}:{values[-1]}" for values in (grid.x_mm, grid.y_mm, grid.z_mm))
        return f"--grid={','.join(spans)}@{grid.pitch_mm}"


def record_run(folder: Path, study: SpeedStudy, shots: int, sprays: int | None = None) -> RecordedRun:
    """Write droplets of the speed study: another spray in every exposure, or so many in ever new pairs."""
    cameras = study_cameras(study.image_size_px)
    names = [f"view{number}" for number in range(1, len(cameras) + 1)]
    header = RunHeader(
        run_id="bench",
        created_utc="2026-01-01T00:00:00+00:00",
        views={name: ViewFormat(study.image_size_px[::-1], BITS) for name in names},
        separation_ns=6400,
    )
    exposure = lru_cache(sprays or 0)(partial(_exposure, study, cameras))
    with RunWriter(folder / "run", header) as writer:
        for index in range(shots):
            exposures = [exposure(seed) for seed in _seeds(index, sprays)]
            if index == 0:
                _write_references(writer, names, exposures[0])
            pairs = zip(names, *exposures, strict=True)
            views = {name: DoubleFrame(a.frame, b.frame, _SEEN, _SEEN) for name, a, b in pairs}
            writer.write_shot(Shot(index, ImageKey.SAMPLE, views))
        writer.finish("completed")
    half_mm = np.array(study.shape[::-1]) * study.grid.pitch_mm / 2
    save_calibration(droplet_calibration(cameras, half_mm), folder / "calibration.json")
    settings = ReconstructionSettings(grid=GridSettings.of(study.grid))
    return RecordedRun(folder / "run", folder / "calibration.json", shots, settings)


def _seeds(index: int, sprays: int | None) -> tuple[int, int]:
    """Sprays of the two exposures of a shot; no pair comes twice before all have come."""
    if sprays is None:
        return 2 * index, 2 * index + 1
    first, apart = index % sprays, 1 + index // sprays % (sprays - 1)
    return first, (first + apart) % sprays


def _exposure(study: SpeedStudy, cameras: list[PinholeCamera], seed: int) -> list[RawExposure]:
    return raw_exposures(spray_images(study, cameras, seed), BITS)


def _write_references(writer: RunWriter, names: list[str], exposures: list[RawExposure]) -> None:
    dark = {name: np.stack([one.dark] * 2) for name, one in zip(names, exposures, strict=True)}
    background = {name: np.stack([one.background] * 2) for name, one in zip(names, exposures, strict=True)}
    writer.write_references(dark, background)
