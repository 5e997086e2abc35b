"""JobTable: all jobs, in one file.

The table is a catalogue: run directories hold the truth, and ``server.lab.jobs.job_recovery`` finds it there.
"""

import json
import threading
from collections.abc import Callable, Collection, Iterable
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from server.lab.errors import Conflict, NotFound
from server.lab.jobs.job import TRANSITIONS, UNSUCCESSFUL, Job, JobKind, JobState, now_utc
from server.lab.jobs.work_progress import PROGRESS_QUERY, WorkProgress
from server.lab.table_file import changing, table_at

_STRANGE = "strange"
_SELECT = """
    SELECT document FROM job
    WHERE state IN (SELECT value FROM json_each(?1)) AND (?2 IS NULL OR run_id = ?2)
        AND json_extract(document, '$.kind') IN (SELECT value FROM json_each(?3))
"""
_TABLE = """
    PRAGMA journal_mode = WAL; PRAGMA synchronous = NORMAL;
    CREATE TABLE IF NOT EXISTS job (
        number INTEGER PRIMARY KEY, id TEXT NOT NULL UNIQUE, run_id TEXT NOT NULL, state TEXT NOT NULL,
        document TEXT NOT NULL
    );
    CREATE INDEX IF NOT EXISTS job_by_state ON job (state, number);
    CREATE INDEX IF NOT EXISTS job_by_run ON job (run_id, number);
"""


class JobTable:
    """All jobs, in one SQLite file; may be used from any thread.

    Parameters
    ----------
    path : Path
        Database file; made if it does not exist.
    """

    def __init__(self, path: Path) -> None:
        self._lock = threading.Lock()
        self._database = table_at(path, _TABLE)
        self._changing = partial(changing, self._database, self._lock, path)

    def close(self) -> None:
        """Close the file, once nobody reads or writes it any more."""
        with self._lock:  # SQLite crashes the process where a connection is closed under a statement
            self._database.close()

    def add(self, job: Job, is_lost: Callable[[Job], bool] = lambda _: False) -> Job:
        """Queue a job. The same work is not done twice: a waiting, running or done job is returned as it is.

        ``is_lost`` tells of a done job whether it has to be done again, because what it made is gone.
        """
        with self._changing():
            known = self._find(job.id)
            if known is None:
                self._insert(job)
                return job
            if known.state not in UNSUCCESSFUL and not (known.state is JobState.DONE and is_lost(known)):
                return known
            return self._replace(known, JobState.QUEUED, result=None, error=None)

    def move(self, job_id: str, to: JobState, *, result: dict[str, Any] | None = None, error: str | None = None) -> Job:
        """Change the state of a job.

        Raises
        ------
        NotFound
            There is no such job.
        Conflict
            That state does not follow its present one.
        """
        with self._changing():
            job = self._known(job_id)
            if to not in TRANSITIONS[job.state]:
                raise Conflict(f"job {job_id} is {job.state}, it cannot become {to}")
            return self._replace(job, to, result=result, error=error)

    def get(self, job_id: str) -> Job:
        """One job; NotFound if there is none."""
        with self._lock:
            return self._known(job_id)

    def newest(
        self,
        run_id: str | None = None,
        states: Iterable[JobState] = tuple(JobState),
        limit: int = 200,
        kinds: Iterable[JobKind] = tuple(JobKind),
    ) -> list[Job]:
        """Jobs of one run or all, of some kinds or all, newest first."""
        return self._select(f"{_SELECT} ORDER BY number DESC LIMIT ?4", run_id, states, limit, kinds)

    def oldest(self, state: JobState, limit: int = -1, kinds: Iterable[JobKind] = tuple(JobKind)) -> list[Job]:
        """Jobs in one state, the longest waiting first; -1 for all of them."""
        return self._select(f"{_SELECT} ORDER BY number LIMIT ?4", None, [state], limit, kinds)

    def requeue_interrupted(self, running: Collection[str] = ()) -> int:
        """Queue again what is said to run and does not, as after the death of a server; how many jobs that were."""
        interrupted = [job for job in self.oldest(JobState.RUNNING) if job.id not in running]
        for job in interrupted:
            self.move(job.id, JobState.QUEUED)
        return len(interrupted)

    def progress(self, run_id: str) -> list[WorkProgress]:
        """How far the work on a run is, a line per result set, newest first."""
        with self._lock:
            return [WorkProgress.of(row) for row in self._database.execute(PROGRESS_QUERY, (run_id,))]

    def restore(self, jobs: Iterable[Job]) -> int:
        """Take in jobs that the table does not know; how many."""
        with self._changing():
            new = [job for job in jobs if self._find(job.id) is None]
            for job in new:
                self._insert(job)
        return len(new)

    def forget(self, run_id: str) -> None:
        """Drop the jobs of a run that has been removed."""
        with self._changing():
            self._database.execute("DELETE FROM job WHERE run_id = ?", (run_id,))

    def set_strangers_aside(self) -> list[str]:
        """Take rows that are no jobs of this version out of queue and lists; their ids. They stay in the file."""
        with self._changing():
            rows = self._database.execute("SELECT id, document FROM job WHERE state <> ?", (_STRANGE,))
            strangers = [job_id for job_id, document in rows if not _is_job(document)]
            for job_id in strangers:
                self._database.execute("UPDATE job SET state = ? WHERE id = ?", (_STRANGE, job_id))
        return strangers

    def _select(
        self, query: str, run_id: str | None, states: Iterable[JobState], limit: int, kinds: Iterable[JobKind]
    ) -> list[Job]:
        with self._lock:
            rows = self._database.execute(query, (_listed(states), run_id, _listed(kinds), limit)).fetchall()
        return [Job.model_validate_json(document) for (document,) in rows]

    def _find(self, job_id: str) -> Job | None:
        row = self._database.execute(
            "SELECT document FROM job WHERE id = ? AND state <> ?", (job_id, _STRANGE)
        ).fetchone()
        return Job.model_validate_json(row[0]) if row else None

    def _known(self, job_id: str) -> Job:
        job = self._find(job_id)
        if job is None:
            raise NotFound(f"there is no job {job_id!r}")
        return job

    def _insert(self, job: Job) -> None:
        self._database.execute(
            "INSERT OR REPLACE INTO job (id, run_id, state, document) VALUES (?, ?, ?, ?)",
            (job.id, job.run_id, job.state, job.model_dump_json()),
        )

    def _replace(self, job: Job, state: JobState, *, result: dict[str, Any] | None, error: str | None) -> Job:
        changed = job.model_copy(update={"state": state, "result": result, "error": error, "changed_utc": now_utc()})
        self._database.execute(
            "UPDATE job SET state = ?, document = ? WHERE id = ?", (state, changed.model_dump_json(), job.id)
        )
        return changed


def _listed(names: Iterable[StrEnum]) -> str:
    return json.dumps([name.value for name in names])


def _is_job(document: str) -> bool:
    try:
        Job.model_validate_json(document)
    except ValidationError:
        return False
    return True
