"""The table of jobs at start-up: a damaged one is set aside, and a lost one found again in the run directories."""

import json
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from server.lab.damage import set_aside, tell
from server.lab.events import EventPublisher
from server.lab.jobs.job import Job, JobKind, finished, shot_job
from server.lab.jobs.job_table import JobTable
from server.lab.results import droplet_summaries, volume_summaries

TABLE_FILE = "jobs.sqlite"
_COMPANIONS = ("-wal", "-shm")
"""Left beside a table whose process was killed; in place they would be mixed into the table that comes after it."""


@contextmanager
def opened_table(data_dir: Path, events: EventPublisher) -> Iterator[JobTable]:
    """The table of a data directory, sound and as complete as the directory can make it, until the block ends."""
    path = data_dir / TABLE_FILE
    if path.exists() and (damage := _damage_of(path)):
        lost = "finished reconstructions and measurements are found again, what waited must be asked for again"
        set_aside(path, f"table of jobs, {damage}: {lost}", events, _COMPANIONS)
    with closing(JobTable(path)) as table:
        if strangers := table.set_strangers_aside():
            tell(path, f"rows that are no jobs of this version are left out: {', '.join(strangers)}", events)
        if not table.newest(limit=1):
            table.restore(jobs_on_disk(data_dir, events))
        yield table


def _damage_of(path: Path) -> str | None:
    """What is wrong with a table; None if nothing is."""
    if path.stat().st_size == 0:
        return "the file is empty"
    try:
        with closing(sqlite3.connect(path)) as database:
            (verdict,) = database.execute("PRAGMA quick_check(1)").fetchone()
            if verdict == "ok":
                database.execute("SELECT id, run_id, state, document FROM job ORDER BY number LIMIT 1").fetchall()
    except sqlite3.Error as error:
        return str(error)
    return None if verdict == "ok" else str(verdict)


def jobs_on_disk(data_dir: Path, events: EventPublisher) -> Iterator[Job]:
    """Finished reconstructions and measurements, as the run directories have them; damaged results are told."""
    for record in sorted(data_dir.glob("*/results/*/settings.json")):
        try:
            yield from _jobs_of(record)
        except (OSError, ValueError, KeyError, TypeError) as error:
            tell(record, f"cannot be read ({error}): its jobs are not in the table of jobs", events)


def _jobs_of(record: Path) -> list[Job]:
    written = json.loads(record.read_text())
    calibration, settings = Path(written["calibration_file"]).stem, json.loads(written["settings"])
    run_id, results_id = record.parents[2].name, record.parent.name
    volumes = [
        (JobKind.RECONSTRUCTION, volume.shot) for volume in volume_summaries(record.parent) if volume.frame == "a"
    ]
    droplets = [(JobKind.MEASUREMENT, droplets.shot) for droplets in droplet_summaries(record.parent)]
    return [
        finished(shot_job(kind, run_id, shot, calibration, results_id, settings)) for kind, shot in volumes + droplets
    ]
