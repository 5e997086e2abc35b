import asyncio
import threading
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest

from server.lab.calibrations import CalibrationStore
from server.lab.duty import Duty
from server.lab.engine.inline_engine import InlineEngine
from server.lab.engine.task import OnProgress, Task, Unavailable, Values
from server.lab.errors import Conflict
from server.lab.events import EventPublisher
from server.lab.jobs.job import Job, JobKind, JobState, check_job, reconstruction_job, shot_job
from server.lab.jobs.job_table import JobTable
from server.lab.runner import JobRunner
from server.lab.watch import CalibrationWatch

DEADLINE_S = 10.0


def job_of(shot: int) -> Job:
    return reconstruction_job("run", shot, "cal", "mlos-0", {"method": "mlos"})


def answer(job: dict[str, Any], should_stop: Callable[[], bool]) -> dict[str, Any]:
    return {"shot": job["shot"], "in": Path(job["results_dir"]).name, "with": Path(job["calibration_file"]).name}


def fail(job: dict[str, Any], should_stop: Callable[[], bool]) -> dict[str, Any]:
    raise OSError(f"no light in shot {job['shot']}")


def last_until_stopped(job: dict[str, Any], should_stop: Callable[[], bool]) -> dict[str, Any]:
    tick = threading.Event()
    while not should_stop():
        tick.wait(0.01)
    return {}


class Laboratory:
    """A runner at work, and a way to wait for the state of a job."""

    def __init__(self, runner: JobRunner, table: JobTable, events: EventPublisher) -> None:
        self.runner = runner
        self.table = table
        self._events = events

    async def trouble(self) -> str:
        """What the first red lamp of the work says."""
        async with asyncio.timeout(DEADLINE_S):
            async for event in self._events.follow(0):
                if event is not None and event.name == "background_work" and event.data["error"]:
                    return str(event.data["error"])
        raise AssertionError("the events ended")

    async def reach(self, job: Job, state: JobState) -> Job:
        async with asyncio.timeout(DEADLINE_S):
            async for event in self._events.follow(0):
                data = event.data if event is not None and event.name == "job_changed" else {}
                if (data.get("job"), data.get("state")) == (job.id, state):
                    return self.table.get(job.id)
        raise AssertionError("the events ended")


@asynccontextmanager
async def at_work(
    tmp_path: Path, task: Callable[..., dict[str, Any]], engine_of: Callable[[], InlineEngine] = InlineEngine
) -> AsyncIterator[Laboratory]:
    events, table = EventPublisher(), JobTable(tmp_path / "jobs.sqlite")
    events.attach()
    async with engine_of() as engine:
        store = CalibrationStore(tmp_path / "calibrations")
        watch = CalibrationWatch(events)
        tasks = dict.fromkeys((JobKind.RECONSTRUCTION, JobKind.MEASUREMENT, JobKind.CHECK), task)
        runner = JobRunner(engine, table, tasks, events, tmp_path, store, watch)
        work = asyncio.create_task(runner.run(Duty("processing", events)))
        yield Laboratory(runner, table, events)
        work.cancel()
        await asyncio.wait([work], timeout=DEADLINE_S)
        assert work.done(), "the work goes on although it was ended"
    table.close()


@pytest.mark.parametrize("steps", range(6))
def test_work_that_is_ended_just_as_a_job_comes_ends(steps: int, tmp_path: Path) -> None:
    async def go() -> None:
        async with at_work(tmp_path, answer) as laboratory:
            await laboratory.reach(laboratory.runner.submit(job_of(0)), JobState.DONE)
            await asyncio.sleep(0.1)  # it waits for the next one
            laboratory.runner.submit(job_of(1))
            for _ in range(steps):
                await asyncio.sleep(0)

    asyncio.run(go())


def test_jobs_are_done_in_the_order_in_which_they_were_asked_for(tmp_path: Path) -> None:
    async def go() -> None:
        async with at_work(tmp_path, answer) as laboratory:
            jobs = [laboratory.runner.submit(job_of(shot)) for shot in range(3)]
            done = [await laboratory.reach(job, JobState.DONE) for job in jobs]
        told = {"in": "mlos-0", "with": "cal.json", "belonging": {"verdict": None, "shots": []}}
        assert [job.result for job in done] == [{"shot": shot, **told} for shot in range(3)]
        assert [job.changed_utc for job in done] == sorted(job.changed_utc for job in done)

    asyncio.run(go())


def test_checks_and_reconstructions_take_turns_beginning_with_a_check(tmp_path: Path) -> None:
    order: list[tuple[str, int]] = []

    def note(job: dict[str, Any], should_stop: Callable[[], bool]) -> dict[str, Any]:
        order.append(("reconstruction" if job["results_dir"] else "check", job["shot"]))
        return {"shot": job["shot"], "views": {}}

    async def go() -> None:
        async with at_work(tmp_path, note) as laboratory:
            jobs = [laboratory.runner.submit(job_of(shot)) for shot in range(3)]
            checks = [laboratory.runner.submit(check_job("run", shot, "cal")) for shot in range(3)]
            for job in (*jobs, *checks):
                await laboratory.reach(job, JobState.DONE)

    asyncio.run(go())
    assert order == [(kind, shot) for shot in range(3) for kind in ("check", "reconstruction")]


def test_the_first_volumes_come_before_the_first_check_and_all_others_after_it(tmp_path: Path) -> None:
    order: list[tuple[str, int]] = []

    def note(job: dict[str, Any], should_stop: Callable[[], bool]) -> dict[str, Any]:
        order.append(("reconstruction" if job["results_dir"] else "check", job["shot"]))
        return {"shot": job["shot"], "verdict": "good", "moved": None, "views": {}, "uncertainty_px": {}}

    async def go() -> None:
        async with at_work(tmp_path, note) as laboratory:
            jobs = laboratory.runner.submit_checked([job_of(0), job_of(1)], "run", "cal", [0])
            first, second = [await laboratory.reach(job, JobState.DONE) for job in jobs]
        assert first.result is not None
        assert first.result["belonging"] == {"verdict": None, "shots": []}
        assert second.result is not None
        assert second.result["belonging"]["verdict"] == "good"

    asyncio.run(go())
    assert order == [("reconstruction", 0), ("check", 0), ("reconstruction", 1)]


def test_droplets_wait_for_volumes_and_take_turns_with_checks(tmp_path: Path) -> None:
    order: list[tuple[str, int]] = []

    def note(job: dict[str, Any], should_stop: Callable[[], bool]) -> dict[str, Any]:
        order.append((Path(job["results_dir"]).name.partition("-")[0] if job["results_dir"] else "check", job["shot"]))
        return {"shot": job["shot"], "views": {}}

    async def go() -> None:
        async with at_work(tmp_path, note) as laboratory:
            asked = [job for shot in range(2) for job in (droplets_of(shot), job_of(shot))]
            jobs = [laboratory.runner.submit(job) for job in asked]
            checks = [laboratory.runner.submit(check_job("run", shot, "cal")) for shot in range(4)]
            for job in (*jobs, *checks):
                await laboratory.reach(job, JobState.DONE)

    asyncio.run(go())
    work = [("mlos", 0), ("mlos", 1), ("droplets", 0), ("droplets", 1)]
    assert order == [one for shot in range(4) for one in (("check", shot), work[shot])]


def droplets_of(shot: int) -> Job:
    return shot_job(JobKind.MEASUREMENT, "run", shot, "cal", "droplets-0", {})


def test_a_job_that_fails_says_why_and_stops_no_other(tmp_path: Path) -> None:
    async def go() -> None:
        async with at_work(tmp_path, fail) as laboratory:
            jobs = [laboratory.runner.submit(job_of(shot)) for shot in range(2)]
            failed = [await laboratory.reach(job, JobState.FAILED) for job in jobs]
        assert [job.error for job in failed] == ["OSError: no light in shot 0", "OSError: no light in shot 1"]

    asyncio.run(go())


def test_running_and_waiting_jobs_are_aborted_and_ended_ones_are_not(tmp_path: Path) -> None:
    async def go() -> None:
        async with at_work(tmp_path, last_until_stopped) as laboratory:
            running, waiting = (laboratory.runner.submit(job_of(shot)) for shot in range(2))
            await laboratory.reach(running, JobState.RUNNING)
            assert (await laboratory.runner.abort(waiting.id)).state is JobState.ABORTED
            await laboratory.runner.abort(running.id)
            await laboratory.reach(running, JobState.ABORTED)
            with pytest.raises(Conflict, match="is aborted"):
                await laboratory.runner.abort(running.id)

    asyncio.run(go())


def test_what_was_running_when_the_server_ended_is_done_by_the_next_one(tmp_path: Path) -> None:
    async def go() -> None:
        async with at_work(tmp_path, last_until_stopped) as first:
            job = first.runner.submit(job_of(0))
            await first.reach(job, JobState.RUNNING)
        async with at_work(tmp_path, answer) as second:
            assert (await second.reach(job, JobState.DONE)).result is not None

    asyncio.run(go())


def test_what_droplets_say_of_the_calibration_comes_with_every_job(tmp_path: Path) -> None:
    check = {"shot": 0, "verdict": "warn", "moved": None, "views": {"view1": 0.5}, "uncertainty_px": {"view1": 0.1}}

    def work(job: dict[str, Any], should_stop: Callable[[], bool]) -> dict[str, Any]:
        return check if job["results_dir"] is None else {"heard": job.get("belonging")}

    async def go() -> None:
        async with at_work(tmp_path, work) as laboratory:
            laboratory.runner.submit_checked([job_of(1)], "run", "cal", [0])
            done = await laboratory.reach(job_of(1), JobState.DONE)
            expected = {"verdict": "warn", "shots": [check]}
            assert done.result == {"heard": expected, "belonging": expected}

    asyncio.run(go())


def test_a_job_that_nobody_is_there_to_do_waits_and_the_lamp_says_why(tmp_path: Path) -> None:
    away = [True]

    async def go() -> None:
        async with at_work(tmp_path, answer, lambda: AwayEngine(away)) as laboratory:
            job = laboratory.runner.submit(job_of(0))
            await laboratory.reach(job, JobState.RUNNING)
            assert "scheduler is away" in await laboratory.trouble()
            assert laboratory.table.get(job.id).state is JobState.QUEUED
            away[0] = False
            assert (await laboratory.reach(job, JobState.DONE)).error is None

    asyncio.run(go())


class AwayEngine(InlineEngine):
    """One that now and then cannot be reached."""

    def __init__(self, away: list[bool]) -> None:
        super().__init__()
        self._away = away

    async def submit(self, job_id: str, task: Task, job: Values, on_progress: OnProgress) -> dict[str, Any]:
        if self._away[0]:
            raise Unavailable("the scheduler is away")
        return await super().submit(job_id, task, job, on_progress)
