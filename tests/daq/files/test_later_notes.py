"""Notes that are changed after a run: run.h5 stays as it is, and whatever carries a run carries them."""

import shutil
from pathlib import Path

import pytest

from daq.errors import RecorderError, ShotFileError
from daq.files import later_notes
from daq.files.later_notes import NOTES_FILE, add_change
from daq.files.repair import repair
from daq.files.run_directory import RunNotes, RunReader, pack
from daq.files.verification import FlawKind, verify
from tests.support.droplet_run import write_run

RECORDED, BETTER, BEST = RunNotes(fluid="water"), RunNotes(fluid="ethanol"), RunNotes(fluid="ethanol", pressure_bar=6)


@pytest.fixture
def run_dir(tmp_path: Path) -> Path:
    return write_run(tmp_path / "run", notes=RECORDED)


def change(run_dir: Path, notes: RunNotes, who: str = "ann") -> None:
    add_change(run_dir, RunReader(run_dir).header, notes, who)


def test_a_change_tells_who_when_and_what_stood_before_and_leaves_the_run_as_it_was(run_dir: Path) -> None:
    recorded = (run_dir / "run.h5").read_bytes()
    assert RunReader(run_dir).notes_changes == ()
    change(run_dir, BETTER)
    change(run_dir, BEST, "bob")
    first, second = RunReader(run_dir).notes_changes
    assert (first.who, first.before, first.notes) == ("ann", RECORDED, BETTER)
    assert (second.who, second.before, second.notes) == ("bob", BETTER, BEST)
    assert first.at_utc <= second.at_utc
    assert RunReader(run_dir).header.notes == RECORDED
    assert (run_dir / "run.h5").read_bytes() == recorded
    assert verify(run_dir).sound


def test_what_stands_there_already_is_no_change(run_dir: Path) -> None:
    change(run_dir, RECORDED)
    assert not (run_dir / NOTES_FILE).exists()


def test_there_is_an_end_of_changes(run_dir: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(later_notes, "MOST_CHANGES", 1)
    change(run_dir, BETTER)
    with pytest.raises(RecorderError, match="changed 1 times"):
        change(run_dir, BEST)
    assert len(RunReader(run_dir).notes_changes) == 1


def test_a_packed_run_carries_them_and_takes_more(run_dir: Path, tmp_path: Path) -> None:
    change(run_dir, BETTER)
    packed = tmp_path / "packed"
    packed.mkdir()
    pack(run_dir, packed / "run.h5")
    assert RunReader(packed).notes_changes == RunReader(run_dir).notes_changes
    change(packed, BEST)
    assert [one.notes for one in RunReader(packed).notes_changes] == [BETTER, BEST]


def spoil(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-7])


def exchange(path: Path) -> None:
    path.write_text(path.read_text().replace('"run_id": "run"', '"run_id": "other"'))


@pytest.mark.parametrize(("harm", "told"), [(spoil, "cannot be read"), (exchange, "is of run 'other'")])
def test_those_that_are_damaged_or_of_another_run_are_named_and_set_aside_by_repair(
    run_dir: Path, tmp_path: Path, harm: object, told: str
) -> None:
    change(run_dir, BETTER)
    assert callable(harm)
    harm(run_dir / NOTES_FILE)
    with pytest.raises(ShotFileError, match=told):
        change(run_dir, BEST)
    with pytest.raises(ShotFileError, match=told):
        pack(run_dir, tmp_path / "packed.h5")
    (flaw,) = verify(run_dir).flaws
    assert (flaw.kind, flaw.file) == (FlawKind.FOREIGN, NOTES_FILE)
    assert any(NOTES_FILE in step for step in repair(run_dir))
    assert verify(run_dir).sound
    assert RunReader(run_dir).notes_changes == ()


def test_a_renamed_copy_of_a_run_keeps_them(run_dir: Path) -> None:
    change(run_dir, BETTER)
    copy = shutil.copytree(run_dir, run_dir.with_name("copy"))
    assert RunReader(copy).notes_changes[-1].notes == BETTER
