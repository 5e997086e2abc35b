"""Small shots of bright particles with their truth, and a recorded run of them."""

from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from daq.files.run_directory import DoubleFrame, ExposureRecord, ImageKey, RunHeader, RunWriter, Shot, ViewFormat
from processing.analysis.droplets.droplet_search import DropletSearch, plan_droplets
from processing.calibration.calibration_file import save_calibration
from processing.calibration.calibration_record import content_id
from processing.studies.droplets import BrightScene, DropletCase, bright_scene
from processing.studies.seen_droplets import droplet_calibration
from processing.studies.simulated_droplets import study_grid
from processing.studies.velocity.double_scenes import DoubleScene, double_scene
from processing.volume import VoxelGrid

SHAPE = (80, 40, 160)
IMAGE_SIZE_PX = (240, 100)
GRID = study_grid(SHAPE)
MARGIN_VOXEL = 6
BOX = "-1.325:1.325,-0.325:0.325,-0.6583:0.6583"
BITS = 12
FULL_SCALE = 4095
LEVEL = 100.0
"""Of the dark image, in grey values."""


def scene(case: DropletCase | None = None, seed: int = 1, grid: VoxelGrid = GRID) -> BrightScene:
    return bright_scene(case or DropletCase(28), grid, IMAGE_SIZE_PX, np.random.default_rng(seed))


def moving_scene(seed: int = 1) -> DoubleScene:
    return double_scene(DropletCase(28), GRID, IMAGE_SIZE_PX, np.random.default_rng(seed))


def search_of(shot: BrightScene, grid: VoxelGrid = GRID, margin_voxel: int = MARGIN_VOXEL) -> DropletSearch:
    return plan_droplets(shot.believed, grid, margin_voxel=margin_voxel)


def write_bright_run(
    run_dir: Path,
    shots: int = 1,
    frames: Literal[1, 2] = 1,
    covered: tuple[str, ...] = (),
    moving: DoubleScene | None = None,
    separation_ns: int | None = 6400,
    **told: Any,
) -> Path:
    """Shots of the same scene, B the same as A but of a moving one; covered views record noise alone.

    ``told`` is more of the header.
    """
    images = moving.images if moving else (scene().images,) * 2
    rng = np.random.default_rng(0)
    names = [f"view{number}" for number in range(1, 5)]
    header = RunHeader(
        run_id=run_dir.name,
        created_utc="2026-01-01T00:00:00+00:00",
        views={name: ViewFormat(IMAGE_SIZE_PX[::-1], BITS) for name in names},
        frames_per_shot=frames,
        separation_ns=separation_ns if frames == 2 else None,
        polarity="bright",
        **told,
    )
    recorded = ExposureRecord(valid=True, frame_id=1, device_timestamp_ns=1)
    views = {}
    for name, *pair in zip(names, *images, strict=True):
        lights = [rng.normal(0, 0.03, image.shape) if name in covered else image for image in pair]
        frame_a, frame_b = (np.clip(np.rint(LEVEL + 400 * light), 0, FULL_SCALE).astype(np.uint16) for light in lights)
        views[name] = DoubleFrame(frame_a, frame_b if frames == 2 else None, recorded, recorded)
    with RunWriter(run_dir, header) as writer:
        for index in range(shots):
            writer.write_shot(Shot(index, ImageKey.SAMPLE, views))
        writer.finish("completed")
    return run_dir


def write_bright_calibration(path: Path) -> Path:
    good = droplet_calibration(scene().believed, np.array([3.0, 1.0, 1.5]))
    save_calibration(replace(good, id=content_id(good)), path)
    return path
