"""A spray of droplets seen by the four views of the paper, and the calibration that belongs to them."""

import time
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from daq.run_plan import ImageKey
from daq.shot import DoubleFrame, ExposureRecord, Image, Shot
from daq.simulation.camera.light import Exposure
from processing.calibration.calibration_file import save_calibration
from processing.geometry import FloatArray
from tests.support.drifting_views import HALF_MM, SIZE_PX, calibration_of, views

VIEWS = ("view1", "view2", "view3", "view4")
LIGHT, RADIUS_PX, DARK_COUNTS = 120, 6, 4
COUNTS_PER_A = {"view1": 19.0, "view2": 12.0, "view3": 8.0, "view4": 30.0}
"""8 bit: at 10 A, view4 saturates."""
_DROPLETS = 70
_FALL_MM = 0.12


def droplet_shot(place_mm: tuple[float, float, float], index: int = 0) -> Shot:
    """A dark disc in every view, where it sees the droplet."""
    frames = {}
    for number, view in enumerate(VIEWS):
        image = np.full(SIZE_PX[::-1], LIGHT, np.uint8)
        _draw(image, number, np.array([place_mm]), [RADIUS_PX])
        seen = ExposureRecord(True, index + 1)
        frames[view] = DoubleFrame(image, image, seen, seen)
    return Shot(index, ImageKey.SAMPLE, frames, host_time_ns=time.time_ns())


def save_droplet_calibration(path: Path) -> None:
    """Write the calibration of these views."""
    save_calibration(calibration_of(views()), path)


def spray_scene(exposure: Exposure) -> Image:
    """Droplets that fall between A and B, before light that is proportional to the current."""
    current_a = sum(pulse.current_a for pulse in exposure.pulses)
    light = COUNTS_PER_A[exposure.view] * current_a * _lens()
    image = light * _shadows(exposure.view, exposure.sequence % 4, exposure.frame)
    noise = np.random.default_rng(exposure.sequence).normal(0, 1, exposure.shape)
    return np.clip(np.rint(DARK_COUNTS + image + noise), 0, 255).astype(np.uint8)


@lru_cache(maxsize=32)
def _shadows(view: str, spray: int, frame: str) -> NDArray[np.float32]:
    rng = np.random.default_rng(spray)
    places_mm = rng.uniform(-HALF_MM, HALF_MM, (_DROPLETS, 3))
    places_mm[:, 1] += _FALL_MM * (frame == "B")
    image = np.ones(SIZE_PX[::-1], np.float32)
    _draw(image, VIEWS.index(view), places_mm, rng.integers(2, 9, _DROPLETS).tolist())
    return np.asarray(cv2.GaussianBlur(image, (0, 0), 0.8), np.float32)


@lru_cache(maxsize=1)
def _lens() -> NDArray[np.float32]:
    """Light of the background, less towards the corners."""
    y, x = np.meshgrid(*(np.linspace(-1, 1, size) for size in SIZE_PX[::-1]), indexing="ij")
    return np.asarray(1 - 0.08 * (x**2 + y**2), np.float32)


def _draw(
    image: NDArray[np.uint8] | NDArray[np.float32], number: int, places_mm: FloatArray, radii: Sequence[int]
) -> None:
    for (u_px, v_px), radius_px in zip(views()[number].project(places_mm), radii, strict=True):
        cv2.circle(image, (round(u_px), round(v_px)), radius_px, 0, -1)
