"""A run of two droplets seen by three known cameras, with its calibration, for tests of what follows recording."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from daq.files.references_file import add_references
from daq.files.run_directory import (
    DoubleFrame,
    ExposureRecord,
    ImageKey,
    RunHeader,
    RunReader,
    RunWriter,
    Shot,
    ViewFormat,
)
from processing.calibration.calibration_file import save_calibration
from processing.calibration.calibration_record import content_id
from processing.calibration.verdict import Verdict
from processing.geometry import PinholeCamera, view_camera
from processing.preprocessing import Polarity
from processing.studies.seen_droplets import droplet_calibration

SHAPE = (120, 160)
SCALE_PX_PER_MM = 20.0
DROPLETS_A_MM = np.array([[0.5, -0.7, 0.3], [-1.2, 0.8, -0.6]])
MOTION_MM = np.array([0.0, 0.2, 0.0])
SEEN = ExposureRecord(valid=True, frame_id=1, device_timestamp_ns=1)
MISSING = ExposureRecord(valid=False)


def cameras() -> dict[str, PinholeCamera]:
    return {
        f"view{number}": view_camera(
            azimuth_deg,
            focal_length_mm=85,
            magnification=0.43,
            scale_px_per_mm=SCALE_PX_PER_MM,
            image_size_px=(SHAPE[1], SHAPE[0]),
        )
        for number, azimuth_deg in enumerate((40, 0, -40), start=1)
    }


def shadowgraph(camera: PinholeCamera, droplets_mm: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Round shadows of 2 px radius before an even light of 200 counts."""
    row, column = np.mgrid[: SHAPE[0], : SHAPE[1]]
    light = np.full(SHAPE, 200.0)
    for u, v in camera.project(droplets_mm):
        light *= 1 - 0.9 * np.exp(-((column - u) ** 2 + (row - v) ** 2) / 4)
    image: NDArray[np.uint8] = np.round(light).astype(np.uint8)
    return image


def grey_values(image: NDArray[Any], bits: int) -> NDArray[np.uint8] | NDArray[np.uint16]:
    return image.astype(np.uint8) if bits == 8 else image.astype(np.uint16)


def write_run(
    run_dir: Path,
    shots: int = 1,
    invalid: tuple[int, ...] = (),
    covered: tuple[str, ...] = (),
    bits: int = 8,
    polarity: Polarity = "shadow",
    droplets_mm: NDArray[np.float64] = DROPLETS_A_MM,
    copies: bool = False,
    **told: Any,
) -> Path:
    """Record shots; in the invalid ones exposure B of view2 is missing; covered views are dark; more of the header.

    No two shots are the very same, unless they are copies.
    """
    views = {name: ViewFormat(SHAPE, bits) for name in cameras()}
    header = RunHeader(
        run_id=run_dir.name,
        views=views,
        polarity=polarity,
        separation_ns=6400,
        **{"created_utc": "2026-01-01T00:00:00+00:00", **told},
    )
    with RunWriter(run_dir, header) as writer:
        for index in range(shots):
            speck = 0 if copies else index % 100
            shot = _shot(index, droplets_mm, valid=index not in invalid, covered=covered, bits=bits, speck=speck)
            writer.write_shot(shot)
        writer.finish("completed")
    return run_dir


def add_background(run_dir: Path, counts: float) -> Path:
    """Even backgrounds: the shots have 200 counts where nothing is in the way."""
    with RunReader(run_dir) as run:
        header = run.header
    images = {name: np.full((2, *SHAPE), counts, np.float32) for name in header.views}
    add_references(run_dir, header, {"background": images})
    return run_dir


def _shot(
    index: int, droplets_mm: NDArray[np.float64], *, valid: bool, covered: tuple[str, ...], bits: int, speck: int
) -> Shot:
    """A shot whose first pixel is darker by so many counts."""
    views = {}
    darker = np.pad([[speck]], [(0, side - 1) for side in SHAPE])
    for name, camera in cameras().items():
        light = name not in covered
        frame_a, frame_b = (
            grey_values(light * (shadowgraph(camera, droplets_mm + step * MOTION_MM) - darker), bits) for step in (0, 1)
        )
        views[name] = DoubleFrame(frame_a, frame_b, SEEN, SEEN)
    if not valid:
        views["view2"] = replace(views["view2"], frame_b=grey_values(np.zeros(SHAPE), bits), record_b=MISSING)
    return Shot(index, ImageKey.SAMPLE if valid else ImageKey.INVALID, views)


def write_calibration(path: Path, verdict: Verdict = Verdict.GOOD, holdout_px: float = 0.02) -> Path:
    """Calibration with the true cameras."""
    good = droplet_calibration(list(cameras().values()), np.array([3.0, 2.5, 1.5]))
    views = {name: replace(view, verdict=verdict, holdout_error_px=holdout_px) for name, view in good.views.items()}
    judged = replace(good, views=views)
    save_calibration(judged.with_id(content_id(judged)), path)
    return path
