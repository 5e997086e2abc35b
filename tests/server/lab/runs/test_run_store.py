"""Lists of many runs: what is told, and that no file is opened that has not changed."""

import os
import shutil
import sqlite3
from contextlib import suppress
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from daq.files.run_directory import (
    DoubleFrame,
    ExposureRecord,
    ImageKey,
    PulsePair,
    RunHeader,
    RunPlan,
    RunWriter,
    Shot,
    ViewFormat,
)
from daq.run.events import RunStatus
from daq.run.state import RunState
from server.lab.errors import NotFound
from server.lab.runs.run_filter import ListedOutcome, RunFilter
from server.lab.runs.run_index import RunIndex
from server.lab.runs.run_store import RunStore
from server.lab.runs.run_summary import ACTIVE, DAMAGED

BEGIN = datetime(2026, 3, 1, 12, tzinfo=UTC)
KEYS = (ImageKey.SAMPLE, ImageKey.INVALID, ImageKey.SAMPLE)


def writer_of(run_dir: Path, created: datetime = BEGIN) -> RunWriter:
    plan = RunPlan(name="spray", shots=len(KEYS), pulse=PulsePair(current_a={"view1": 12.0}))
    views = {"view1": ViewFormat((4, 6), 8)}
    return RunWriter(run_dir, RunHeader(run_id=run_dir.name, created_utc=created.isoformat(), views=views, plan=plan))


def shot(index: int, key: ImageKey) -> Shot:
    frame, record = np.zeros((4, 6), np.uint8), ExposureRecord(valid=True, frame_id=1, device_timestamp_ns=1)
    return Shot(index, key, {"view1": DoubleFrame(frame, frame, record, record)})


def write_run(run_dir: Path, created: datetime = BEGIN) -> Path:
    with writer_of(run_dir, created) as writer:
        for index, key in enumerate(KEYS):
            writer.write_shot(shot(index, key))
        writer.finish("completed")
    return run_dir


def spoil(path: Path, *, noticed: bool) -> None:
    """Overwrite a file; unless it is to be noticed, with the time that it had."""
    before = path.stat()
    path.write_bytes(b"no HDF5")
    if not noticed:
        os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))


@pytest.fixture
def run_dir(tmp_path: Path) -> Path:
    return write_run(tmp_path / "runs" / "20260301T120000-spray")


@pytest.mark.parametrize("name", ["nozzle #3", ".kept", "-dash", 'say "hi"', "50 %", "ü"])
def test_a_run_whose_folder_cannot_be_an_id_is_listed_with_what_to_do(run_dir: Path, name: str) -> None:
    run_dir.rename(run_dir.with_name(name))
    store = RunStore(run_dir.parent, RunStatus)
    (told,) = store.newest()
    assert (told.run_id, told.outcome) == (name, DAMAGED)
    assert "no id of a run" in told.cause
    assert told.remedy.startswith("rename the folder ")
    with pytest.raises(NotFound, match=r"no id of a run.*rename the folder"):
        store.directory(name)


def test_a_run_that_has_not_changed_is_not_opened_by_another_server_either(run_dir: Path, tmp_path: Path) -> None:
    first = RunStore(run_dir.parent, RunStatus, RunIndex(tmp_path / "runs.sqlite"))
    (told,) = first.newest()
    assert (told.outcome, told.shots_recorded, told.shots_valid) == ("completed", 3, 2)
    spoil(run_dir / "run.h5", noticed=False)
    for index in range(3):
        spoil(run_dir / "shots" / f"{index}.h5", noticed=False)
    second = RunStore(run_dir.parent, RunStatus, RunIndex(tmp_path / "runs.sqlite"))
    assert second.newest() == [told]
    assert second.image_keys(run_dir.name).tolist() == list(KEYS)
    spoil(run_dir / "run.h5", noticed=True)
    assert [run.outcome for run in second.newest()] == [DAMAGED]


def test_who_filters_a_list_opens_only_the_runs_that_have_changed(run_dir: Path, tmp_path: Path) -> None:
    other = write_run(run_dir.with_name("20260301T120001-other"), BEGIN + timedelta(seconds=1))
    store = RunStore(run_dir.parent, RunStatus, RunIndex(tmp_path / "runs.sqlite"))
    completed, damaged = RunFilter(outcome=ListedOutcome.COMPLETED), RunFilter(outcome=ListedOutcome.DAMAGED)
    assert store.page(9, 0, completed)[1] == 2
    spoil(run_dir / "run.h5", noticed=False)
    spoil(other / "run.h5", noticed=True)
    assert [run.run_id for run in store.page(9, 0, completed)[0]] == [run_dir.name]
    assert [run.run_id for run in store.page(9, 0, damaged)[0]] == [other.name]


def test_a_shot_that_was_lost_is_told(run_dir: Path) -> None:
    store = RunStore(run_dir.parent, RunStatus)
    assert store.summary(run_dir.name).shots_valid == 2
    (run_dir / "shots" / "0.h5").unlink()
    assert store.summary(run_dir.name).shots_valid == 1
    assert store.image_keys(run_dir.name).tolist() == [ImageKey.INVALID, *KEYS[1:]]


@pytest.mark.parametrize("damage", [b"", b"garbage" * 1000], ids=["empty", "garbage"])
def test_an_index_that_is_damaged_is_made_anew(run_dir: Path, tmp_path: Path, damage: bytes) -> None:
    file = tmp_path / "runs.sqlite"
    index = RunIndex(file)
    told = RunStore(run_dir.parent, RunStatus, index).newest()
    index.close()
    file.write_bytes(damage)
    assert RunStore(run_dir.parent, RunStatus, RunIndex(file)).newest() == told


def test_runs_are_listed_where_the_disk_takes_no_index(run_dir: Path, tmp_path: Path) -> None:
    """Full or read-only: then somebody looks for what to delete."""
    index = RunIndex(tmp_path / "runs.sqlite")
    index._database.execute("PRAGMA query_only = 1")
    seen = []
    with suppress(sqlite3.Error):
        seen = RunStore(run_dir.parent, RunStatus, index).newest()
    assert [run.run_id for run in seen] == [run_dir.name]


def test_an_index_cut_in_its_middle_is_made_anew(tmp_path: Path) -> None:
    runs = [write_run(tmp_path / "runs" / f"20260301T1200{second:02d}-spray") for second in range(8)]
    file = tmp_path / "runs.sqlite"
    index = RunIndex(file)
    told = RunStore(tmp_path / "runs", RunStatus, index).newest()
    index.close()
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    assert RunStore(tmp_path / "runs", RunStatus, RunIndex(file)).newest() == told
    assert len(told) == len(runs)


def test_a_run_that_was_deleted_leaves_the_index_although_another_one_came(tmp_path: Path) -> None:
    index = RunIndex(tmp_path / "runs.sqlite")
    store = RunStore(tmp_path / "runs", RunStatus, index)
    gone = write_run(tmp_path / "runs" / "20260301T120000-gone")
    for run_dir in (gone, write_run(tmp_path / "runs" / "20260301T120001-stays")):
        store.summary(run_dir.name)
    shutil.rmtree(gone)
    write_run(tmp_path / "runs" / "20260301T120002-new")
    assert [run.run_id for run in store.newest()] == ["20260301T120002-new", "20260301T120001-stays"]
    rows = index._database.execute("SELECT run_id FROM run ORDER BY run_id").fetchall()
    assert rows == [("20260301T120001-stays",), ("20260301T120002-new",)]


def test_where_no_index_can_be_written_runs_are_listed_even_so(run_dir: Path, tmp_path: Path) -> None:
    store = RunStore(run_dir.parent, RunStatus, RunIndex(tmp_path / "no such folder" / "runs.sqlite"))
    assert [run.run_id for run in store.newest()] == [run_dir.name]


def test_pages_together_are_the_whole_list_newest_first(tmp_path: Path) -> None:
    """Two begin in the same second, and one has no time in its name."""
    names = ["20260301T120000-b", "20260301T120000-a", "20260301T120005-c", "imported", "20260301T115900-d"]
    after_s = [0.2, 0.7, 5.0, 2.0, -60.0]
    for name, later_s in zip(names, after_s, strict=True):
        write_run(tmp_path / name, BEGIN + timedelta(seconds=later_s))
    store = RunStore(tmp_path, RunStatus)
    whole = [run.run_id for run in store.newest()]
    assert whole == [name for _, name in sorted(zip(after_s, names, strict=True), reverse=True)]
    assert [run.run_id for offset in range(0, 6, 2) for run in store.newest(2, offset)] == whole
    assert store.page(2, 4)[1] == 5


def test_a_run_that_is_recorded_is_told_as_it_grows(tmp_path: Path) -> None:
    run_dir = tmp_path / "20260301T120000-spray"
    status = RunStatus()
    store = RunStore(tmp_path, lambda: status)
    with writer_of(run_dir) as writer:
        for index, key in enumerate(KEYS):
            writer.write_shot(shot(index, key))
            status = RunStatus(state=RunState.ACQUIRING, run_id=run_dir.name, shots_recorded=index + 1)
            told = store.summary(run_dir.name)
            assert (told.outcome, told.shots_recorded, told.shots_valid) == (ACTIVE, index + 1, None)
            assert store.image_keys(run_dir.name).tolist() == list(KEYS[: index + 1])
        writer.finish("completed")
    status = RunStatus(run_id=run_dir.name, shots_recorded=3)
    told = store.summary(run_dir.name)
    assert (told.outcome, told.shots_recorded, told.shots_valid) == ("completed", 3, 2)


def test_a_run_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(NotFound, match="there is no run 'gone'"):
        RunStore(tmp_path, RunStatus).image_keys("gone")
