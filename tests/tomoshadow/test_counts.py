"""Counts are whole numbers: what is none is refused by its name, and not rounded, cut or taken for another."""

import inspect
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest

import tomoshadow as ts
from daq.files.run_directory import RunReader
from processing.reconstruction.planning.plan import Plan
from tests.tomoshadow.test_reconstruction import CAMERAS, GRID, calibration, spot

FRAME = np.full((24, 32), 200, np.uint8)
NOISE: Any = np.random.default_rng(1).random((16, 16, 16)).astype(np.float32)
LISTED: Any = NOISE.tolist()


@cache
def plan() -> Plan:
    return ts.plan(calibration(), GRID)


def seen() -> Any:
    return {name: spot(name) for name in CAMERAS}


def solved(method: str, **options: Any) -> object:
    return getattr(ts, method)(plan(), seen(), **options)


def measured(**options: Any) -> object:
    return ts.measure(calibration(), seen(), ts.VoxelGrid.centred((8, 16, 16), 0.06), **options)


def correlated(**options: Any) -> object:
    return ts.quality_factor(NOISE, NOISE, **{"window": 8, "step": 8, **options})


def shown(**options: Any) -> object:
    return ts.intensity(FRAME, **{"bits": 8, "background": FRAME.astype(np.float32), **options})


def read(**options: Any) -> object:
    run: Any = object.__new__(RunReader)
    return ts.shot_intensities(run, **{"shot": 0, **options})


TAKEN: dict[str, Callable[[Any], object]] = {
    "Checkerboard.columns": lambda value: ts.Checkerboard(value, 7, 2.0),
    "Checkerboard.rows": lambda value: ts.Checkerboard(11, value, 2.0),
    "Dots.columns": lambda value: ts.Dots(2.0, columns=value, rows=7),
    "Dots.rows": lambda value: ts.Dots(2.0, columns=11, rows=value),
    "example.seed": ts.example,
    "gavlos.threads": lambda value: solved("gavlos", threads=value),
    "intensity.bits": lambda value: shown(bits=value),
    "intensity.minimum_window_px": lambda value: shown(minimum_window_px=value),
    "mart.iterations": lambda value: solved("mart", iterations=value),
    "mart.threads": lambda value: solved("mart", threads=value),
    "measure.margin_voxel": lambda value: measured(margin_voxel=value),
    "measure.seed": lambda value: measured(seed=value),
    "measure.threads": lambda value: measured(threads=value),
    "measure.twins": lambda value: measured(twins=value),
    "minlos.threads": lambda value: solved("minlos", threads=value),
    "mlos.threads": lambda value: solved("mlos", threads=value),
    "quality_factor.step": lambda value: correlated(step=value),
    "quality_factor.window": lambda value: correlated(window=value),
    "shot_intensities.minimum_window_px": lambda value: read(minimum_window_px=value),
    "shot_intensities.shot": lambda value: read(shot=value),
    "smart.iterations": lambda value: solved("smart", iterations=value),
    "smart.threads": lambda value: solved("smart", threads=value),
    "track_droplets.half_window": lambda value: ts.track_droplets([], half_window=value),
}


def counts_of_python() -> list[str]:
    """Every argument that is annotated to be a whole number."""
    return sorted(
        f"{name}.{parameter.name}"
        for name in dir(ts)
        if inspect.isfunction(getattr(ts, name))
        for parameter in inspect.signature(getattr(ts, name)).parameters.values()
        if parameter.annotation in (int, int | None, "int", "int | None")
    )


def test_no_count_is_left_out_here() -> None:
    assert sorted(TAKEN) == counts_of_python()


@pytest.mark.parametrize("value", [2.5, 4.0, True, "3", [3], float("nan"), -1])
@pytest.mark.parametrize("taken", TAKEN)
def test_what_is_no_count_is_refused_by_name(taken: str, value: object) -> None:
    with pytest.raises(ValueError, match=rf"{taken.split('.')[1]} .*: a whole number from \d, please"):
        TAKEN[taken](value)


def test_counts_of_numpy_are_counts() -> None:
    assert len(ts.smart(plan(), seen(), iterations=np.int64(2)).residuals) == 3  # type: ignore[arg-type]
    assert ts.Checkerboard(np.int32(11), 7, 2.0).columns == 11  # type: ignore[arg-type]


@pytest.mark.parametrize("shape", [(3, 4), (1, 2, 3, 4), (3, 4, 5.5), (3, 4, True), ("3", "4", "5"), (0, 1, 1), 5])
def test_a_grid_has_three_whole_numbers_of_voxels(shape: Any) -> None:
    with pytest.raises(ValueError, match=r"grid: shape .* \(nz, ny, nx\), please"):
        ts.VoxelGrid(shape, (0.0, 0.0, 0.0), 0.1)


@pytest.mark.parametrize(
    "origin_mm", [(0.0, 0.0), (0.0, 0.0, 0.0, 0.0), ("0", "0", "0"), (0.0, 0.0, np.inf), 5.0, None]
)
def test_a_grid_begins_at_three_finite_numbers(origin_mm: Any) -> None:
    with pytest.raises(ValueError, match=r"grid: origin .* \(x, y, z\) in mm, please"):
        ts.VoxelGrid((3, 4, 5), origin_mm, 0.1)


@pytest.mark.parametrize("pitch_mm", [0, -0.1, np.nan, np.inf, "0.1", True, None, (0.1, 0.1, 0.1)])
def test_a_grid_has_one_pitch(pitch_mm: Any) -> None:
    with pytest.raises(ValueError, match=r"grid: pitch .* above 0 in mm, please"):
        ts.VoxelGrid((3, 4, 5), (0.0, 0.0, 0.0), pitch_mm)


VOLUMES = {
    "a list": (LISTED, "is a list"),
    "float64": (NOISE.astype(np.float64), "is of float64"),
    "int64": (NOISE.astype(np.int64), "is of int64"),
    "bool": (NOISE > 0.5, "is of bool"),
    "text": (NOISE.astype("U4"), "is of <U4"),
}


@pytest.mark.parametrize("kind", VOLUMES)
def test_a_volume_that_is_written_is_of_a_type_that_is_stored(tmp_path: Any, kind: str) -> None:
    volume, said = VOLUMES[kind]
    with pytest.raises(ValueError, match=rf"volume {said}; an array \(z, y, x\) of float32 or float16 or uint8"):
        ts.write_volume(tmp_path / "a.vtkhdf", volume, ts.VoxelGrid.centred((16, 16, 16), 0.1))


def test_a_list_has_no_quality() -> None:
    with pytest.raises(ValueError, match="truth is a list: an array"):
        ts.quality_factor(LISTED, NOISE, 8, 8)
    with pytest.raises(ValueError, match=r"windows of 8 .* do not fit shape \(16, 16\)"):
        ts.quality_factor(NOISE[0], NOISE[0], 8, 8)
