"""What a dead process left: closed once, named, set aside, never deleted; what a living one writes is left alone."""

import json
import shutil
from datetime import datetime
from pathlib import Path

import pytest

from daq.causes import CauseCode
from daq.files.recovery import INTERRUPTED_CAUSE, recover
from daq.files.repair import repair
from daq.files.run_directory import RunReader, RunWriter
from tests.daq.files.test_run_directory import header_of, shot_of

RUN_ID = header_of().run_id


@pytest.fixture
def killed(tmp_path: Path) -> Path:
    """A run of two shots whose process was killed while it wrote a third one."""
    run_dir = tmp_path / RUN_ID
    with RunWriter(run_dir, header_of()) as writer:
        for index in range(2):
            writer.write_shot(shot_of(header_of(), index))
        writer.stage(2, writer.encode(shot_of(header_of(), 2)))
    return run_dir


def told(data_dir: Path) -> list[str]:
    return [f"{one.run_id}: {one.text}" for one in recover(data_dir)]


def test_a_killed_run_is_closed_once_with_cause_and_last_sign_of_life(killed: Path) -> None:
    last_s = (killed / "shots" / "2.h5.part").stat().st_mtime
    part, outcome = told(killed.parent)
    aside = killed / "set-aside" / "2.h5.part"
    assert part == f"{RUN_ID}: 2.h5.part was not committed, it is set aside as {aside}"
    reader = RunReader(killed)
    assert (reader.outcome, reader.cause, reader.shot_count) == ("interrupted", INTERRUPTED_CAUSE, 2)
    assert abs(datetime.fromisoformat(reader.ended_utc).timestamp() - last_s) < 0.05
    assert [(one.code, one.at_utc) for one in reader.causes] == [(CauseCode.PROCESS_DIED, reader.ended_utc)]
    assert outcome == f"{RUN_ID}: interrupted at {reader.ended_utc}: {INTERRUPTED_CAUSE}"
    assert aside.stat().st_size > 0
    assert all(reader.read_shot(index).valid for index in range(2))
    assert told(killed.parent) == []


def test_what_was_set_aside_before_is_not_overwritten(killed: Path) -> None:
    (killed / "set-aside").mkdir()
    (killed / "set-aside" / "2.h5.part").write_text("earlier")
    recover(killed.parent)
    assert (killed / "set-aside" / "2.h5.part").read_text() == "earlier"
    assert (killed / "set-aside" / "2.h5.part-2").is_file()


def test_a_run_that_is_being_written_is_left_alone(tmp_path: Path) -> None:
    with RunWriter(tmp_path / RUN_ID, header_of()) as writer:
        writer.stage(0, writer.encode(shot_of(header_of(), 0)))
        assert told(tmp_path) == []
        writer.commit(0)
        writer.finish("completed")
    assert told(tmp_path) == []
    assert RunReader(tmp_path / RUN_ID).outcome == "completed"


def test_a_note_of_the_outcome_is_written_into_the_run_and_goes(killed: Path) -> None:
    note = killed.with_name(f"{RUN_ID}.outcome.json")
    closing = {"outcome": "failed", "cause": "the disk is full", "ended_utc": "2026-11-22T11:00:00+00:00"}
    note.write_text(json.dumps(closing))
    assert f"{RUN_ID}: failed at 2026-11-22T11:00:00+00:00: the disk is full" in told(killed.parent)
    reader = RunReader(killed)
    assert (reader.outcome, reader.cause, reader.ended_utc) == tuple(closing.values())
    assert not note.exists()


def test_a_note_that_nobody_can_read_changes_nothing(killed: Path) -> None:
    killed.with_name(f"{RUN_ID}.outcome.json").write_text("{")
    recover(killed.parent)
    assert RunReader(killed).outcome == "interrupted"


def test_a_directory_without_run_file_is_set_aside_and_named(tmp_path: Path) -> None:
    (tmp_path / RUN_ID / "shots").mkdir(parents=True)
    (tmp_path / RUN_ID / "run.h5.reserve").write_bytes(b"made first")
    (tmp_path / "calibrations").mkdir()
    aside = tmp_path / "set-aside" / RUN_ID
    assert told(tmp_path) == [f"{RUN_ID}: it has no run.h5 and is no run, it is set aside as {aside}"]
    assert (aside / "shots").is_dir()
    assert (tmp_path / "calibrations").is_dir()
    assert told(tmp_path) == []


def test_a_directory_that_has_lost_its_run_file_says_how_to_get_it_back(killed: Path) -> None:
    (killed / "run.h5").unlink()
    aside = killed.parent / "set-aside" / RUN_ID
    wanted = f"{RUN_ID}: it has no run.h5, it is set aside as {aside}; tomoshadow repair {aside} writes it anew"
    assert told(killed.parent) == [f"{wanted} from its shots"]
    list(repair(aside))
    assert RunReader(aside).shot_count == 2


def test_a_damaged_run_is_named_and_hides_no_other(killed: Path) -> None:
    damaged = killed.with_name("20200101T000000-damaged")
    shutil.copytree(killed, damaged)
    (damaged / "run.h5").write_bytes(b"nonsense")
    assert any(
        text.startswith(f"{damaged.name}: its outcome cannot be written: {damaged / 'run.h5'}: cannot be read")
        for text in told(killed.parent)
    )
    assert RunReader(killed).outcome == "interrupted"
