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
    write_true_cameras,
    write_true_spray,
)

OLD_RUNS = Path(__file__).parents[2] / "fixtures" / "v0.1.0" / "runs"


def spray(count: int, seed: int = 0) -> Spray:
    random = np.random.default_rng(seed)
    return Spray.of_droplets(random.normal(size=(count, 3)), random.uniform(size=count), random.normal(size=(count, 3)))


def test_sprays_come_back_by_sequence_to_a_nanometre(tmp_path: Path) -> None:
    path = tmp_path / "run" / "truth" / "truth.h5"
    write_true_cameras(path, {})
    fired = {7: FiredSpray(5000, spray(3)), 12: FiredSpray(5008, spray(2000, seed=1)), 13: FiredSpray(0, spray(0))}
    for sequence, expected in fired.items():
        write_true_spray(path, sequence, expected)
    for sequence, expected in fired.items():
        found = read_true_spray(path, sequence)
        assert found.time_ns == expected.time_ns
        for field in fields(Spray):
            read, written = (getattr(of.spray, field.name) for of in (found, expected))
            assert read.dtype == written.dtype
            np.testing.assert_allclose(read, written, rtol=1e-7, err_msg=field.name)


def test_a_spray_that_was_cut_off_while_it_was_written_is_none(tmp_path: Path) -> None:
    path = tmp_path / "truth.h5"
    write_true_cameras(path, {})
    (tmp_path / "sprays").mkdir()
    (tmp_path / "sprays" / "3.h5.part").write_bytes(b"half a file")
    with pytest.raises(TruthFileError, match="no spray of firing 3"):
        read_true_spray(path, 3)


def test_the_truth_of_the_first_version_is_read() -> None:
    """Its sprays were in the same file as its cameras."""
    (path,) = OLD_RUNS.glob("*-spray/truth/truth.h5")
    with h5py.File(path) as file:
        assert file.attrs["version"] == 1
        sequences = [int(name) for name in file["sprays"]]
    assert len(read_true_cameras(path)) >= 3
    assert sequences
    assert all(len(read_true_spray(path, sequence).spray) > 0 for sequence in sequences)


def test_cameras_come_back_and_project_the_same(tmp_path: Path) -> None:
    cameras = paper_cameras(binning=4)
    write_true_cameras(tmp_path / "truth.h5", cameras)
    points_mm = np.random.default_rng(0).uniform(-5, 5, (50, 3))
    read = read_true_cameras(tmp_path / "truth.h5")
    assert list(read) == list(cameras)
    for view, camera in cameras.items():
        np.testing.assert_array_equal(read[view].project(points_mm), camera.project(points_mm))
        assert read[view].image_size_px == camera.image_size_px


def test_an_unknown_firing_is_named(tmp_path: Path) -> None:
    write_true_cameras(tmp_path / "truth.h5", {})
    write_true_spray(tmp_path / "truth.h5", 1, FiredSpray(0, spray(1)))
    with pytest.raises(TruthFileError, match=r"truth\.h5: no spray of firing 2"):
        read_true_spray(tmp_path / "truth.h5", 2)


def test_other_files_are_refused_by_name(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file.attrs["schema"] = "something else"
    for name in ("other.h5", "none.h5"):
        with pytest.raises(TruthFileError, match=name):
            read_true_cameras(tmp_path / name)


def test_every_dataset_has_units(tmp_path: Path) -> None:
    write_true_cameras(tmp_path / "truth.h5", paper_cameras())
    write_true_spray(tmp_path / "truth.h5", 1, FiredSpray(0, spray(1)))
    units: list[str] = []
    for path in (tmp_path / "truth.h5", tmp_path / "sprays" / "1.h5"):
        with h5py.File(path) as file:
            file.visititems(
                lambda _, item: units.append(item.attrs["units"]) if isinstance(item, h5py.Dataset) else None
            )
    assert len(units) > len(fields(Spray))
    assert all(units)
