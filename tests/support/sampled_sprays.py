"""Sprays of which droplets are sampled directly, as files have them: no image is drawn, and the truth is a formula."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from processing.analysis.droplets.droplet_file import StoredDroplets, write_columns
from processing.reconstruction.settings import GridSettings
from processing.volume import VoxelGrid

BOX = VoxelGrid((100, 40, 100), (-4.95, 8.05, -4.95), 0.1)
"""10 x 4 x 10 mm, 8 to 12 mm below a nozzle at the origin."""


def stored_shot(
    diameters_um: NDArray[np.float64],
    points_mm: NDArray[np.float64] | None = None,
    velocities_m_s: NDArray[np.float64] | None = None,
    shot: int = 0,
    grid: VoxelGrid = BOX,
    **told: Any,
) -> StoredDroplets:
    """A shot of one exposure; without points its droplets are in the middle of the box."""
    count = len(diameters_um)
    middle_mm = np.array([axis.mean() for axis in (grid.x_mm, grid.y_mm, grid.z_mm)])
    points_mm = np.tile(middle_mm, (count, 1)) if points_mm is None else points_mm
    columns: dict[str, Any] = {"frame": np.full(count, "a"), "diameter_um": diameters_um}
    columns |= dict(zip(("x_mm", "y_mm", "z_mm"), points_mm.T, strict=True))
    if velocities_m_s is not None:
        columns |= dict(zip(("u_m_s", "v_m_s", "w_m_s"), velocities_m_s.T, strict=True))
    exposures: dict[str, Any] = {"a": {"verdict": "good", "reasons": [], "residual_over_noise": 1.0}}
    provenance = {
        "run": "spray",
        "calibration": "cal-1",
        "method_version": 5,
        "shot": shot,
        "settings": '{"polarity": "shadow"}',
        "grid": GridSettings.of(grid).model_dump_json(),
        "exposures": json.dumps(exposures),
        **told,
    }
    return StoredDroplets(columns, provenance)


def in_box(shot: StoredDroplets) -> StoredDroplets:
    """What is seen of it in the box."""
    seen = np.ones(len(shot.columns["frame"]), bool)
    for name, axis in (("x_mm", BOX.x_mm), ("y_mm", BOX.y_mm), ("z_mm", BOX.z_mm)):
        places: Any = shot.columns[name]
        seen &= (places >= axis[0]) & (places <= axis[-1])
    return StoredDroplets({name: values[seen] for name, values in shot.columns.items()}, shot.provenance)


def write_results(folder: Path, shots: Sequence[StoredDroplets], **told: str) -> Path:
    """A directory as ``measure`` writes it, but for its settings; more of the provenance."""
    folder.mkdir(parents=True, exist_ok=True)
    for shot in shots:
        columns = {**shot.columns, "frame": shot.columns["frame"].astype("S1")}
        columns["diameter_raw_um"] = columns["diameter_um"]
        write_columns(folder / f"shot_{shot.provenance['shot']:05d}_droplets.h5", columns, {**shot.provenance, **told})
    return folder


def cone_points_mm(
    rng: np.random.Generator, count: int, half_angle_deg: float, thickness_deg: float = 0.0
) -> NDArray[np.float64]:
    """Points of a hollow cone around +y from the origin, evenly along it from 8 to 12 mm."""
    along_mm = rng.uniform(8, 12, count)
    angle = np.radians(half_angle_deg + thickness_deg * rng.uniform(-0.5, 0.5, count))
    azimuth = rng.uniform(0, 2 * np.pi, count)
    radius_mm = along_mm * np.tan(angle)
    return np.column_stack([radius_mm * np.cos(azimuth), along_mm, radius_mm * np.sin(azimuth)])


def cone_shots(seed: int = 0, shots: int = 8, count: int = 150, half_angle_deg: float = 20.0) -> list[StoredDroplets]:
    """Shots of a hollow cone whose droplets fly away from the nozzle, large ones faster: speed = 5 + D / 10 m/s."""
    rng = np.random.default_rng(seed)
    made = []
    for shot in range(shots):
        number = int(rng.poisson(count))
        diameters_um = 40 * np.exp(0.4 * rng.standard_normal(number))
        points_mm = cone_points_mm(rng, number, half_angle_deg, 4.0)
        directions = points_mm / np.linalg.norm(points_mm, axis=1)[:, None]
        made.append(stored_shot(diameters_um, points_mm, (5 + diameters_um / 10)[:, None] * directions, shot))
    return made
