"""JobRunner: takes jobs from the table to the engine, and writes down what becomes of them.

The table is the queue. Whatever is asked for while the server is down, or was running when it died, is done later.
"""

import asyncio
import contextlib
import secrets
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from daq.files.atomic_file import PART_SUFFIX
from processing.calibration.verdict import BELONGING
from processing.runs.droplets.measured_shot import droplets_path
from server.lab.calibrations import CalibrationStore
from server.lab.duty import Duty, pause
from server.lab.engine.task import Engine, Task, TaskAborted, TaskError, Unavailable
from server.lab.errors import Conflict, told
from server.lab.events import EventPublisher
from server.lab.jobs.job import Job, JobKind, JobState
from server.lab.jobs.job_table import JobTable
from server.lab.results import is_kept, remaking
from server.lab.watch import CalibrationWatch

_CHECKS_REMEMBERED, _VOLUMES_REMEMBERED = 1000, 100
_LOOK_AGAIN_S = 5.0
_REST_S = 1.0
_STORE_S = 600.0


_SLOW = {JobKind.CHECK, JobKind.MEASUREMENT}


class JobRunner:
    """Runs queued jobs, as many at a time as the engine has workers.

    Parameters
    ----------
    engine : Engine
        Where they run; started.
    table : JobTable
        The queue and the account of all jobs.
    tasks : Mapping[JobKind, Task]
        Work function by kind of job.
    events : EventPublisher
        Gets ``job_changed`` and ``job_progress``.
    data_dir : Path
        Folder of the run directories.
    calibrations : CalibrationStore
        Where calibrations are read from and written to.
    watch : CalibrationWatch
        Learns from checks; may hold a reconstruction back, or refuse it.
    """

    def __init__(
        self,
        engine: Engine,
        table: JobTable,
        tasks: Mapping[JobKind, Task],
        events: EventPublisher,
        data_dir: Path,
        calibrations: CalibrationStore,
        watch: CalibrationWatch,
    ) -> None:
        self._engine = engine
        self._table = table
        self._tasks = tasks
        self._events = events
        self._data_dir = data_dir
        self._calibrations = calibrations
        self._watch = watch
        self._loop = asyncio.get_running_loop()
        self._changed = asyncio.Event()
        self._storing = asyncio.Lock()
        self._unfinished = data_dir / "unfinished_volume"
        self._running: set[str] = set()
        self._checked_last = False

    def submit(self, job: Job) -> Job:
        """Queue a job; from any thread. The same work is not done twice."""
        queued = self._table.add(job, self._is_lost)
        self._tell(queued)
        self._loop.call_soon_threadsafe(self._changed.set)
        if following := self._watch.learn(queued):
            self.submit(following)
        return queued

    def submit_checked(self, jobs: Sequence[Job], run_id: str, calibration: str, shots: Iterable[int]) -> list[Job]:
        """Queue jobs that trust a calibration, and checks of some shots of their run; from any thread.

        The watch knows of the checks before the first job is queued, and so holds back those that have to wait. A
        check of a run whose check is under way comes after that.
        """
        content = self._calibrations.content_id(calibration)
        checks = [self._watch.next_check(run_id, calibration, shot, content) for shot in shots]
        try:
            return [self.submit(job) for job in jobs]
        finally:
            for check in filter(None, checks):
                self.submit(check)

    async def abort(self, job_id: str) -> Job:
        """Abort a job: a waiting one at once, a running one at its next step.

        Raises
        ------
        NotFound
            There is no such job.
        Conflict
            It has ended already.
        """
        if job_id in self._running:
            await self._engine.abort(job_id)
            return await asyncio.to_thread(self._table.get, job_id)
        return await self._move(job_id, JobState.ABORTED)

    async def store(self, volume: Path) -> None:
        """Make the file of a volume of which a preview is kept, as soon as a worker is free.

        Raises
        ------
        Conflict
            It cannot be made any more, or not in time; the text says why.
        Damaged
            Nobody can read any more how it was made.
        """
        try:
            async with asyncio.timeout(_STORE_S), self._storing:  # who asks for the same meanwhile finds it there
                if not await asyncio.to_thread(volume.is_file):
                    await self._store(volume)
        except TimeoutError as error:
            raise Conflict(f"{volume.name} took more than {_STORE_S:g} s: others are before it, ask later") from error

    async def _store(self, volume: Path) -> None:
        made = await asyncio.to_thread(remaking, volume)
        arguments = {**made, "calibration_file": str(self._calibrations.path(Path(made["calibration_file"]).stem))}
        # A name of its own: one that was asked for before and took too long is still being told to stop.
        name = f"store {volume.parent.name}/{volume.stem} {secrets.token_hex(4)}"
        task = self._tasks[JobKind.RECONSTRUCTION]
        await asyncio.to_thread(self._unfinished.write_text, str(volume.parent))
        try:
            await self._engine.submit(name, task, arguments, lambda _steps: None)
        except TaskError as error:
            raise Conflict(f"{volume.name} cannot be made again: {error}") from error
        await asyncio.to_thread(self._unfinished.unlink, missing_ok=True)

    def _remove_unfinished(self) -> None:
        """Of the volume that was being stored when the server ended."""
        with contextlib.suppress(OSError, ValueError):
            for part in Path(self._unfinished.read_text()).glob(f"*.vtkhdf*{PART_SUFFIX}"):
                part.unlink()
            self._unfinished.unlink()

    async def run(self, duty: Duty) -> None:
        """Work until cancelled; jobs that are then unfinished are taken up by the next start."""
        await asyncio.to_thread(self._take_up)
        async with asyncio.TaskGroup() as group:
            while True:
                self._changed.clear()
                with duty.item("queue"):
                    for job in await asyncio.to_thread(self._waiting, frozenset(self._running)):
                        if self._may_start(job):
                            self._running.add(job.id)
                            self._checked_last = job.kind is JobKind.CHECK
                            group.create_task(self._perform(job, duty))
                await self._wait_for_change()

    async def _wait_for_change(self) -> None:
        """Look again after a while even so: a look that failed is not the last one."""
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(_LOOK_AGAIN_S):  # wait_for of Python 3.11 forgets that it was cancelled
                await self._changed.wait()

    def _take_up(self) -> None:
        self._remove_unfinished()
        self._table.requeue_interrupted()
        for job in reversed(self._table.newest(limit=_CHECKS_REMEMBERED, kinds=[JobKind.CHECK])):
            self._watch.learn(job)
        for job in reversed(self._table.newest(limit=_VOLUMES_REMEMBERED, kinds=[JobKind.RECONSTRUCTION])):
            self._watch.compared(job, job.result or {})

    def _waiting(self, running: frozenset[str]) -> list[Job]:
        """Who may be next: checks and all else take turns, so that neither keeps the other waiting.

        The first check of a run comes after the first volumes. Volumes take seconds, droplets of a spray minutes:
        they come after all volumes that wait.
        """
        self._table.requeue_interrupted(running)
        checks = self._table.oldest(JobState.QUEUED, self._engine.workers, [JobKind.CHECK])
        quick = self._table.oldest(JobState.QUEUED, self._engine.workers, set(JobKind) - _SLOW)
        droplets = self._table.oldest(JobState.QUEUED, self._engine.workers, [JobKind.MEASUREMENT])
        others = [*quick, *droplets]
        others_first = self._checked_last or any(self._watch.goes_ahead(job) for job in quick)
        return [*others, *checks] if others_first else [*checks, *others]

    def _may_start(self, job: Job) -> bool:
        has_room = len(self._running) < self._engine.workers
        return has_room and job.id not in self._running and not self._watch.holds(job)

    async def _perform(self, job: Job, duty: Duty) -> None:
        try:
            with duty.item("jobs"):
                await self._attempt(job)
        finally:
            self._running.discard(job.id)
            self._changed.set()

    async def _attempt(self, job: Job) -> None:
        """Bring a job to its end; one that the server itself cannot do has failed, with the reason.

        One that nobody is there to do is queued again.
        """
        try:
            await self._move(job.id, JobState.RUNNING)
            await self._settle(job)
        except Conflict:
            return  # aborted between being read from the table and being started
        except Unavailable:
            await pause(_REST_S)
            await self._move(job.id, JobState.QUEUED)
            raise
        except Exception as error:
            await pause(_REST_S)  # what is queued again at once would be tried again at once, for ever
            await self._move(job.id, JobState.FAILED, error=told(error))
            raise

    async def _settle(self, job: Job) -> None:
        if refusal := self._watch.refusal(job):
            await self._move(job.id, JobState.FAILED, error=refusal)
            return
        belonging = self._watch.belonging(job)
        try:
            arguments = {**self._arguments(job), BELONGING: belonging}
            result = await self._engine.submit(
                job.id, self._tasks[job.kind], arguments, partial(self._tell_progress, job.id)
            )
        except TaskAborted:
            await self._move(job.id, JobState.ABORTED)
        except Unavailable:
            raise
        except TaskError as error:
            await self._move(job.id, JobState.FAILED, error=str(error))
        else:
            known = {} if belonging is None else {BELONGING: belonging}
            await self._move(job.id, JobState.DONE, result={**self._watch.compared(job, result), **known})

    def _is_lost(self, job: Job) -> bool:
        """Whether the files of a done job are gone, or some of them."""
        if job.kind is JobKind.CALIBRATION:
            return not self._calibrations.path(job.calibration).is_file()
        if job.kind is JobKind.CHECK or job.results_id is None or job.shot is None:
            return False
        results_dir = self._data_dir / job.run_id / "results" / job.results_id
        if job.kind is JobKind.MEASUREMENT:
            return not droplets_path(results_dir, job.shot).is_file()
        written = (job.result or {}).get("volumes") or [{"file": f"shot_{job.shot:05d}_a.vtkhdf"}]
        return not all(is_kept(results_dir / volume["file"]) for volume in written)

    def _arguments(self, job: Job) -> dict[str, Any]:
        run_dir = self._data_dir / job.run_id
        return {
            "run_dir": str(run_dir),
            "shot": job.shot,
            "calibration_file": str(self._calibrations.path(job.calibration)),
            "results_dir": str(run_dir / "results" / job.results_id) if job.results_id else None,
            "settings": job.settings,
        }

    async def _move(self, job_id: str, to: JobState, **more: Any) -> Job:
        job = await asyncio.to_thread(partial(self._table.move, job_id, to, **more))
        self._tell(job)
        if following := self._watch.learn(job):
            await asyncio.to_thread(self.submit, following)
        return job

    def _tell(self, job: Job) -> None:
        self._events.publish(
            "job_changed",
            job=job.id,
            kind=job.kind,
            run=job.run_id,
            shot=job.shot,
            state=job.state,
            error=job.error,
        )

    def _tell_progress(self, job_id: str, steps: int) -> None:
        self._events.publish("job_progress", job=job_id, steps=steps)
