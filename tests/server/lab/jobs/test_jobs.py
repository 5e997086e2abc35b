import sqlite3
import threading
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from daq.errors import DiskFull, DiskReadOnly, StorageError
from server.lab.errors import Conflict, NotFound
from server.lab.jobs.job import TRANSITIONS, Job, JobKind, JobState, calibration_job, reconstruction_job
from server.lab.jobs.job_table import JobTable


@pytest.fixture
def table(tmp_path: Path) -> Iterator[JobTable]:
    table = JobTable(tmp_path / "jobs.sqlite")
    yield table
    table.close()


def job_of(shot: int) -> Job:
    return reconstruction_job("run-1", shot, "cal-1", "mlos-12345678", {"method": "mlos"})


def test_a_job_keeps_what_it_was_asked_and_what_it_answered(table: JobTable) -> None:
    job = table.add(job_of(3))
    table.move(job.id, JobState.RUNNING)
    done = table.move(job.id, JobState.DONE, result={"volumes": []})
    assert table.get(job.id) == done
    assert (done.kind, done.shot, done.result, done.settings) == (
        JobKind.RECONSTRUCTION,
        3,
        {"volumes": []},
        {"method": "mlos"},
    )


def test_the_same_work_is_done_once_but_failed_work_can_be_asked_for_again(table: JobTable) -> None:
    table.add(job_of(0))
    table.move(job_of(0).id, JobState.RUNNING)
    assert table.add(job_of(0)).state is JobState.RUNNING
    table.move(job_of(0).id, JobState.FAILED, error="no light")
    again = table.add(job_of(0))
    assert (again.state, again.error) == (JobState.QUEUED, None)
    assert len(table.newest()) == 1


@given(st.lists(st.sampled_from(JobState), max_size=12))
def test_only_the_transition_table_moves_a_job(path: list[JobState]) -> None:
    table = JobTable(Path(":memory:"))
    state = table.add(job_of(0)).state
    for wanted in path:
        if wanted in TRANSITIONS[state]:
            state = table.move(job_of(0).id, wanted).state
            assert state is wanted
        else:
            with pytest.raises(Conflict, match=rf"is {state}, it cannot become {wanted}"):
                table.move(job_of(0).id, wanted)
    assert table.get(job_of(0).id).state is state
    table.close()


def test_the_longest_waiting_job_is_next_and_lists_show_the_newest_first(table: JobTable) -> None:
    for shot in range(3):
        table.add(job_of(shot))
    table.add(calibration_job("run-2", "cal-2", "pinhole"))
    assert [job.shot for job in table.oldest(JobState.QUEUED, limit=2)] == [0, 1]
    assert [job.run_id for job in table.newest()] == ["run-2", "run-1", "run-1", "run-1"]
    assert [job.shot for job in table.newest(run_id="run-1", limit=2)] == [2, 1]
    assert table.newest(states=[JobState.DONE]) == []


def test_what_was_running_when_the_server_died_waits_again(tmp_path: Path) -> None:
    before = JobTable(tmp_path / "jobs.sqlite")
    for shot in range(3):
        before.add(job_of(shot))
    before.move(job_of(0).id, JobState.RUNNING)
    before.move(job_of(1).id, JobState.ABORTED)
    before.close()
    after = JobTable(tmp_path / "jobs.sqlite")
    assert after.requeue_interrupted() == 1
    assert [job.state for job in after.newest()] == [JobState.QUEUED, JobState.ABORTED, JobState.QUEUED]
    after.close()


def test_an_unknown_job_is_named(table: JobTable) -> None:
    with pytest.raises(NotFound, match="no job 'x'"):
        table.get("x")


def test_a_table_is_closed_once_its_readers_are_done(tmp_path: Path) -> None:
    for attempt in range(20):
        table = JobTable(tmp_path / f"{attempt}.sqlite")
        table.restore(job_of(shot) for shot in range(50))
        readers = [_Reader(table) for _ in range(2)]
        for reader in readers:
            assert reader.has_read.wait(10)
        table.close()
        for reader in readers:
            reader.join(10)
            assert "closed database" in reader.ended_by


class _Reader(threading.Thread):
    """Reads a table until it is closed, as the pages of a server do that ends."""

    def __init__(self, table: JobTable) -> None:
        super().__init__(daemon=True)
        self._table = table
        self.has_read = threading.Event()
        self.ended_by = ""
        self.start()

    def run(self) -> None:
        try:
            while self._table.newest():
                self.has_read.set()
        except sqlite3.ProgrammingError as error:
            self.ended_by = str(error)


@pytest.mark.parametrize(("pragma", "kind"), [("query_only = ON", DiskReadOnly), ("max_page_count = 1", DiskFull)])
def test_a_disk_that_takes_no_job_is_told(tmp_path: Path, pragma: str, kind: type[StorageError]) -> None:
    with closing(JobTable(tmp_path / "jobs.sqlite")) as table:
        table._database.execute(f"PRAGMA {pragma}")
        jobs = [reconstruction_job("run", shot, "cal", "mlos-1", {}) for shot in range(1000)]
        with pytest.raises(kind, match=r"jobs\.sqlite"):
            table.restore(jobs)


def test_a_table_that_cannot_be_read_is_closed_again(tmp_path: Path) -> None:
    (tmp_path / "jobs.sqlite").write_bytes(b"no table" * 1000)
    opened = len(list(Path("/proc/self/fd").iterdir()))
    with pytest.raises(sqlite3.DatabaseError):
        JobTable(tmp_path / "jobs.sqlite")
    assert len(list(Path("/proc/self/fd").iterdir())) == opened
