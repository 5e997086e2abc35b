"""What programs of others see in a run: NeXus readers and xarray. Each test skips where its reader is not installed."""

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import xarray
from nexusformat.nexus import nxload

from daq.files.run_directory import RunNotes, RunPlan, RunReader, Spray, pack
from daq.run_plan import PulsePair
from tests.support.droplet_run import write_run

NOTES = RunNotes(
    operator="A. Berg", fluid="water", nozzle="hollow cone 0.2 mm", pressure_bar=6.0, more={"flow_l_min": 1.2}
)


@pytest.fixture(scope="module")
def run_dir(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_run(tmp_path_factory.mktemp("runs") / "run", notes=NOTES, spray=Spray(nozzle_mm=(0, -5, 0)))


def test_notes_and_nozzle_travel_with_the_run(run_dir: Path) -> None:
    header = RunReader(run_dir).header
    assert header.notes == NOTES
    assert header.spray == Spray(nozzle_mm=(0.0, -5.0, 0.0), axis=(0.0, 1.0, 0.0))


def test_notes_are_where_nexus_has_them(run_dir: Path) -> None:
    with h5py.File(run_dir / "run.h5") as run:
        entry = run["entry"]
        assert entry["title"].asstr()[()] == "run"
        assert entry["user/name"].asstr()[()] == "A. Berg"
        assert (entry["sample/pressure"][()], entry["sample/pressure"].attrs["units"]) == (6.0, "bar")


def test_no_dataset_outside_of_data_groups_names_axes(run_dir: Path) -> None:
    """NeXus knows the attribute there alone; readers take it for names of datasets."""
    named: list[str] = []
    with h5py.File(run_dir / "run.h5") as run:
        run.visititems(lambda name, item: named.append(name) if "axes" in item.attrs else None)
    assert named == [f"entry/data_view{number}" for number in (1, 2, 3)]


def test_a_plan_takes_its_notes_along() -> None:
    plan = RunPlan(name="x", shots=1, pulse=PulsePair(current_a={"view1": 1.0}), notes=NOTES)
    assert RunPlan.model_validate_json(plan.model_dump_json()) == plan


@pytest.mark.parametrize(
    ("wrong", "reason"),
    [
        ({"nozzle_mm": (0, 0, 0), "axis": (0, 0, 0)}, "no direction"),
        ({"nozzle_mm": (0, 0, float("nan"))}, "nozzle_mm"),
        ({"nozzle_mm": (0, 0, 1e6)}, "10000"),
    ],
)
def test_a_nozzle_that_is_nowhere_is_refused(wrong: dict[str, Any], reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        Spray.model_validate(wrong)


def test_nexusformat_reads_a_run(run_dir: Path) -> None:
    root = nxload(str(run_dir / "run.h5"))
    assert "view1:NXdetector" in root.tree
    data = root["entry/data_view1"]
    np.testing.assert_array_equal(data.nxsignal[0, 1].nxdata, RunReader(run_dir).read_shot(0).views["view1"].frame_b)


def test_nexusformat_sees_all_shots_of_a_packed_run(tmp_path: Path) -> None:
    """Of a run that is not packed it shows one, as the page on file formats says."""
    write_run(tmp_path / "run", shots=2)
    pack(tmp_path / "run", tmp_path / "packed.h5")
    frames = nxload(str(tmp_path / "packed.h5"))["cameras/view1/frames"]
    np.testing.assert_array_equal(frames[1, 1].nxdata, RunReader(tmp_path / "run").read_shot(1).views["view1"].frame_b)


def test_xarray_reads_a_run(run_dir: Path) -> None:
    view = xarray.open_dataset(run_dir / "run.h5", group="/cameras/view1", engine="h5netcdf", phony_dims="sort")
    np.testing.assert_array_equal(view.frames[0, 0], RunReader(run_dir).read_shot(0).views["view1"].frame_a)
    assert view.device_timestamp_ns.attrs["units"] == "ns"


@pytest.mark.parametrize("notes", [{"operator": "A\0"}, {"remark": "\0"}, {"more": {"batch": "7\0"}}], ids=str)
def test_a_text_that_no_file_takes_is_refused(notes: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="NUL, which ends a text in HDF5"):
        RunNotes.model_validate(notes)
