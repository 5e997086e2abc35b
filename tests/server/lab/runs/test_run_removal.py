"""Deleting a run: by its name only, never under somebody's hands, and nothing of it is left."""

from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest

from daq.errors import AlreadyHeld, DiskReadOnly
from daq.files.lock_file import hold_folder
from daq.files.run_directory import PulsePair, RunHeader, RunPlan, RunWriter, ViewFormat
from daq.run.events import RunStatus
from daq.run.state import RunState
from server.lab.errors import Conflict, NotFound, Unprocessable
from server.lab.jobs.job import JobState, reconstruction_job
from server.lab.jobs.job_table import JobTable
from server.lab.runs.run_index import RunIndex
from server.lab.runs.run_removal import RemovedRun, remove_run
from server.lab.runs.run_store import RunStore
from server.lab.runs.unkept_runs import UnkeptRuns
from tests.server.lab.runs.test_run_store import write_run

NAME = "20260301T120000-dark"


class House:
    """Runs on the disk, and all that know of them."""

    def __init__(self, folder: Path) -> None:
        self.data_dir, self.status = folder, RunStatus()
        self.run_dir = write_run(folder / NAME)
        self.index, self.jobs = RunIndex(folder / "runs.sqlite"), JobTable(folder / "jobs.sqlite")
        self.runs, self.unkept = RunStore(folder, lambda: self.status, self.index), UnkeptRuns(folder, self.jobs)

    def remove(self, typed: str = NAME) -> RemovedRun:
        return remove_run(self.runs, self.unkept, self.jobs, NAME, typed)


@pytest.fixture
def house(tmp_path: Path) -> Iterator[House]:
    house = House(tmp_path)
    with closing(house.jobs), closing(house.index):
        yield house


def test_a_run_goes_with_its_results_jobs_and_what_was_remembered_of_it(house: House) -> None:
    (house.run_dir / "results" / "mlos-1").mkdir(parents=True)
    other = write_run(house.data_dir / "20260301T120001-stays")
    assert len(house.runs.newest()) == 2
    job = house.jobs.add(reconstruction_job(NAME, 0, "cal", "mlos-1", {}))
    for state in (JobState.RUNNING, JobState.DONE):
        house.jobs.move(job.id, state)
    assert house.remove() == RemovedRun(run_id=NAME, was_reference_of=())
    assert not list(house.data_dir.rglob(f"*{NAME}*"))
    assert house.jobs.newest() == []
    assert house.index._database.execute("SELECT run_id FROM run").fetchall() == [(other.name,)]
    with pytest.raises(NotFound):
        house.remove()


@pytest.mark.parametrize("typed", ["", "dark", NAME.lower(), f"{NAME} "])
def test_another_name_deletes_nothing(house: House, typed: str) -> None:
    with pytest.raises(Unprocessable, match="writes its name"):
        house.remove(typed)
    assert house.run_dir.is_dir()


def test_a_run_that_is_recorded_or_worked_on_stays(house: House) -> None:
    house.status = RunStatus(state=RunState.ACQUIRING, run_id=NAME)
    with pytest.raises(Conflict, match="is being recorded"):
        house.remove()
    house.status = RunStatus()
    with hold_folder(house.run_dir), pytest.raises(AlreadyHeld):
        house.remove()
    house.jobs.add(reconstruction_job(NAME, 0, "cal", "mlos-1", {}))
    with pytest.raises(Conflict, match="abort its jobs first"):
        house.remove()
    assert house.run_dir.is_dir()


def test_it_is_told_whose_reference_a_run_was(house: House) -> None:
    plan = RunPlan(name="spray", shots=1, pulse=PulsePair(current_a={"view1": 12.0}), references=(NAME,))
    header = RunHeader(
        run_id="later", created_utc="2026-03-02T00:00:00", views={"view1": ViewFormat((4, 6), 8)}, plan=plan
    )
    with RunWriter(house.data_dir / "later", header) as writer:
        writer.finish("completed")
    assert house.remove().was_reference_of == ("later",)


def test_a_damaged_run_can_be_deleted_and_what_a_crash_left_goes_too(house: House) -> None:
    (house.run_dir / "run.h5").write_bytes(b"no HDF5")
    (house.data_dir / "removed" / "older").mkdir(parents=True)
    house.remove()
    assert not (house.data_dir / "removed").exists()


def test_of_several_who_delete_a_run_at_once_one_does_and_the_others_find_none(house: House) -> None:
    def remove(_: int) -> type[Exception] | None:
        try:
            house.remove()
        except (NotFound, OSError) as error:
            return type(error)
        return None

    with ThreadPoolExecutor(8) as threads:
        assert Counter(threads.map(remove, range(8))) == {None: 1, NotFound: 7}


def test_the_files_of_a_run_are_gone_although_the_disk_takes_no_note_of_it(house: House) -> None:
    house.jobs._database.execute("PRAGMA query_only = ON")
    with pytest.raises(DiskReadOnly):
        house.remove()
    assert not list(house.data_dir.rglob(f"*{NAME}*"))


def test_the_last_run_is_gone_too_once_it_is_deleted(house: House) -> None:
    house.status = replace(house.status, run_id=NAME, plan=RunPlan(name="dark", shots=1, pulse=PulsePair(current_a={})))
    house.remove()
    with pytest.raises(NotFound):
        house.runs.summary(NAME)
