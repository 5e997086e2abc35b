"""Files of droplets with a second table: what was written is read, and files without it open."""

from pathlib import Path

import h5py
import numpy as np
import pytest

from processing.analysis.droplets.droplet_file import DropletFileError, read_droplets, write_columns, write_droplets
from processing.analysis.droplets.droplet_table import SizedDroplets
from processing.analysis.objects.liquid_objects import LiquidObjects

ONE = LiquidObjects(
    points_mm=np.array([[0.1, 0.2, 0.3]]),
    classes=np.array(["ligament"]),
    lengths_mm=np.array([0.6]),
    widths_mm=np.array([0.06]),
    thicknesses_mm=np.array([0.05]),
    length_sd_mm=np.array([0.02]),
    directions=np.array([[0.0, 1.0, 0.0]]),
    own_share=np.array([0.8]),
    open=np.array([True]),
)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path, none = tmp_path / "shot.h5", SizedDroplets.none()
    write_droplets(path, {"a": none, "b": none}, {"run": "spray"}, objects={"a": ONE, "b": LiquidObjects.none()})
    return path


def test_objects_are_read_as_they_were_written(file: Path) -> None:
    stored = read_droplets(file)
    assert len(stored.columns["frame"]) == 0
    assert (stored.objects["frame"].tolist(), stored.objects["class"].tolist()) == (["a"], ["ligament"])
    assert stored.objects["length_mm"].tolist() == [0.6]
    assert stored.objects["open"].tolist() == [1]


def test_a_file_without_objects_opens(tmp_path: Path) -> None:
    write_droplets(tmp_path / "old.h5", {"a": SizedDroplets.none()}, {"run": "spray"})
    with h5py.File(tmp_path / "old.h5") as file:
        assert "objects" not in file
    assert read_droplets(tmp_path / "old.h5").objects == {}


def test_objects_that_were_changed_are_told(file: Path) -> None:
    with h5py.File(file, "r+") as changed:
        del changed["objects/length_mm"]
        changed["objects/length_mm"] = np.zeros(3)
    with pytest.raises(DropletFileError, match="was changed: its columns have 1 to 3 rows"):
        read_droplets(file)


@pytest.mark.parametrize("place_mm", [np.nan, np.inf])
def test_a_droplet_that_is_nowhere_is_told(tmp_path: Path, place_mm: float) -> None:
    columns = {
        "frame": np.array([b"a"]),
        "x_mm": np.zeros(1),
        "z_mm": np.array([place_mm]),
        "u_m_s": np.array([np.nan]),
    }
    write_columns(tmp_path / "shot.h5", columns, {"run": "spray"})
    with pytest.raises(DropletFileError, match="was changed: z_mm of a droplet is not finite"):
        read_droplets(tmp_path / "shot.h5")


@pytest.mark.parametrize(
    ("name", "text"),
    [
        *[(name, "{") for name in ("exposures", "grid", "spray", "settings", "notes", "velocity")],
        ("exposures", '{"a": {"verdict": "great"}}'),
        ("exposures", '{"a": {"verdict": "good", "hidden": {"volume_share": 2.0}}}'),
        ("exposures", '{"a": {"verdict": "good", "hidden": {"measured_percent": {"xy": [[101]]}}}}'),
        ("exposures", '{"a": {"verdict": "good", "twins": {"classes": [{"number": 3, "placed": 1, "found": 2}]}}}'),
        ("grid", '{"shape": [0, 1, 2], "origin_mm": [0, 0, 0], "pitch_mm": 0.1}'),
        ("spray", '{"nozzle_mm": [0, 1]}'),
        ("notes", "[1]"),
    ],
)
def test_a_text_that_was_changed_is_told(tmp_path: Path, name: str, text: str) -> None:
    write_droplets(tmp_path / "shot.h5", {"a": SizedDroplets.none()}, {"run": "spray", name: text})
    with pytest.raises(DropletFileError, match=f"shot.h5: was changed: {name}"):
        read_droplets(tmp_path / "shot.h5")
