"""Shots that somebody looks at, of a run that is deleted meanwhile."""

from pathlib import Path

import pytest

from daq.errors import ShotFileError
from daq.files.run_directory import RunReader
from server.lab.errors import NotFound
from server.lab.runs.shot_seen import shot_of
from tests.support.droplet_run import write_run


def test_a_shot_of_a_run_that_was_deleted_meanwhile_is_not_found(tmp_path: Path) -> None:
    run = RunReader(write_run(tmp_path / "run", shots=2))
    assert shot_of(run, 1).index == 1
    run.run_dir.rename(tmp_path / "removed")
    with pytest.raises(NotFound, match="there is no run 'run': it was deleted"):
        shot_of(run, 0)


def test_a_shot_whose_file_is_gone_is_damaged(tmp_path: Path) -> None:
    run = RunReader(write_run(tmp_path / "run", shots=2))
    for file in (run.run_dir / "shots").iterdir():
        file.write_bytes(b"torn")
    with pytest.raises(ShotFileError):
        shot_of(run, 0)
