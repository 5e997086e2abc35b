"""The truth of a run survives its file, and is asked for by the sequence number of the firing."""

from dataclasses import fields
from pathlib import Path

import h5py
import numpy as np
import pytest

from processing.synthetic.paper_rig import paper_cameras
from processing.synthetic.spray import Spray
from processing.synthetic.truth_file import (
    FiredSpray,
    TruthFileError,
    read_true_cameras,
    read_true_spray,
    write_truth,
)


def spray(count: int, seed: int = 0) -> Spray:
    random = np.random.default_rng(seed)
    return Spray.of_droplets(random.normal(size=(count, 3)), random.uniform(size=count), random.normal(size=(count, 3)))


def test_sprays_come_back_by_sequence_bit_for_bit(tmp_path: Path) -> None:
    path = tmp_path / "run" / "truth" / "truth.h5"
    fired = {7: FiredSpray(5000, spray(3)), 12: FiredSpray(5008, spray(2000, seed=1))}
    write_truth(path, {}, fired)
    for sequence, expected in fired.items():
        found = read_true_spray(path, sequence)
        assert found.time_ns == expected.time_ns
        for field in fields(Spray):
            np.testing.assert_array_equal(getattr(found.spray, field.name), getattr(expected.spray, field.name))


def test_cameras_come_back_and_project_the_same(tmp_path: Path) -> None:
    cameras = paper_cameras(binning=4)
    write_truth(tmp_path / "truth.h5", cameras, {})
    points_mm = np.random.default_rng(0).uniform(-5, 5, (50, 3))
    read = read_true_cameras(tmp_path / "truth.h5")
    assert list(read) == list(cameras)
    for view, camera in cameras.items():
        np.testing.assert_array_equal(read[view].project(points_mm), camera.project(points_mm))
        assert read[view].image_size_px == camera.image_size_px


def test_an_unknown_firing_is_named(tmp_path: Path) -> None:
    write_truth(tmp_path / "truth.h5", {}, {1: FiredSpray(0, spray(1))})
    with pytest.raises(TruthFileError, match=r"truth\.h5: no spray of firing 2"):
        read_true_spray(tmp_path / "truth.h5", 2)


def test_other_files_are_refused_by_name(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file.attrs["schema"] = "something else"
    for name in ("other.h5", "none.h5"):
        with pytest.raises(TruthFileError, match=name):
            read_true_cameras(tmp_path / name)


def test_every_dataset_has_units(tmp_path: Path) -> None:
    write_truth(tmp_path / "truth.h5", paper_cameras(), {1: FiredSpray(0, spray(1))})
    with h5py.File(tmp_path / "truth.h5") as file:
        datasets: list[h5py.Dataset] = []
        file.visititems(lambda _, item: datasets.append(item) if isinstance(item, h5py.Dataset) else None)
        assert datasets
        assert all(dataset.attrs["units"] for dataset in datasets)
