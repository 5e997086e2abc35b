"""verify, repair and pack: what they find in a run, what they mend, and what they leave alone."""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from daq.files import repair as repairing
from daq.files import verification
from daq.files.header import RunClosing
from daq.files.outcome_note import write_note
from daq.files.run_directory import RunReader, RunWriter
from server.cli.main import main
from tests.daq.files.test_run_directory import assert_same, header_of, shot_of
from tests.daq.run.test_recorder import unshare_works
from tests.support.command_line import refused, told

HEADER = header_of()


@pytest.fixture
def run_dir(tmp_path: Path) -> Path:
    """A sound run of three shots."""
    with RunWriter(tmp_path / HEADER.run_id, HEADER) as writer:
        for index in range(3):
            writer.write_shot(shot_of(HEADER, index))
        writer.finish("completed")
    return tmp_path / HEADER.run_id


def shot(run_dir: Path, index: int) -> Path:
    return run_dir / "shots" / f"{index}.h5"


def missing(run_dir: Path) -> None:
    shot(run_dir, 1).unlink()


def truncated(run_dir: Path) -> None:
    os.truncate(shot(run_dir, 1), shot(run_dir, 1).stat().st_size // 2)


def empty(run_dir: Path) -> None:
    shot(run_dir, 1).write_bytes(b"")


def damaged(run_dir: Path) -> None:
    with h5py.File(shot(run_dir, 1)) as file:
        chunk = file["/cameras/view2/frames"].id.get_chunk_info(1)
    content = bytearray(shot(run_dir, 1).read_bytes())
    content[chunk.byte_offset + chunk.size // 2] ^= 0x10
    shot(run_dir, 1).write_bytes(content)


def of_another_run(run_dir: Path) -> None:
    other = HEADER.model_copy(update={"run_id": "other"})
    with RunWriter(run_dir.parent / "other", other) as writer:
        writer.write_shot(shot_of(other, 0))
    shutil.copy(run_dir.parent / "other" / "shots" / "0.h5", shot(run_dir, 1))


def renamed(run_dir: Path) -> None:
    shutil.copy(shot(run_dir, 2), shot(run_dir, 1))


def nonsense(run_dir: Path) -> None:
    shot(run_dir, 1).write_bytes(b"nonsense" * 100)


def a_part(run_dir: Path) -> None:
    (run_dir / "shots" / "1.h5.part").write_bytes(b"torn")


def a_picture(run_dir: Path) -> None:
    (run_dir / "shots" / "1.png").write_bytes(b"picture")


def open_for_ever(run_dir: Path) -> None:
    shutil.rmtree(run_dir)
    with RunWriter(run_dir, HEADER) as writer:
        for index in range(3):
            writer.write_shot(shot_of(HEADER, index))


FLAWS: list[tuple[Callable[[Path], None], str, str, bool]] = [
    (missing, "missing", "shots/1.h5", False),
    (truncated, "truncated", "shots/1.h5", False),
    (empty, "truncated", "shots/1.h5", False),
    (damaged, "damaged", "shots/1.h5", False),
    (nonsense, "unreadable", "shots/1.h5", False),
    (of_another_run, "foreign", "shots/1.h5", False),
    (renamed, "renamed", "shots/1.h5", False),
    (a_part, "not_committed", "shots/1.h5.part", True),
    (a_picture, "foreign", "shots/1.png", True),
    (open_for_ever, "no_outcome", "run.h5", True),
]
"""Harm, what verify calls it, the file, and whether repair makes the run sound again."""


def test_a_sound_run_is_told_with_all_its_frames(run_dir: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (found,) = told(capsys, "verify", run_dir)["runs"]
    counts = {"sound": True, "outcome": "completed", "shots": 3, "sound_shots": 3, "frames": 12, "flaws": []}
    assert found == {"run": str(run_dir), **counts}


@pytest.mark.parametrize(("harm", "kind", "file", "mended"), FLAWS, ids=[harm.__name__ for harm, *_ in FLAWS])
def test_a_flaw_is_named_and_mended_or_left_alone(
    run_dir: Path,
    capsys: pytest.CaptureFixture[str],
    harm: Callable[[Path], None],
    kind: str,
    file: str,
    mended: bool,
) -> None:
    harm(run_dir)
    before = {path.name: path.read_bytes() for path in (run_dir / "shots").iterdir()}
    found = told(capsys, "verify", run_dir, status=1)
    assert not found["passed"]
    assert [(flaw["kind"], flaw["file"]) for flaw in found["runs"][0]["flaws"]] == [(kind, file)]
    after = told(capsys, "repair", run_dir, status=0 if mended else 1)
    assert after["sound"] == mended
    kept = {path.name: path.read_bytes() for folder in ("shots", "set-aside") for path in (run_dir / folder).glob("*")}
    assert kept == before, "nothing is changed, nothing is deleted"
    assert told(capsys, "repair", run_dir, status=0 if mended else 1)["done"] == []


def test_a_run_without_its_shots_says_how_many_there_were(run_dir: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shutil.rmtree(run_dir / "shots")
    (found,) = told(capsys, "verify", run_dir, status=1)["runs"]
    assert (found["outcome"], found["shots"], found["sound_shots"]) == ("completed", 3, 0)
    (flaw,) = found["flaws"]
    assert (flaw["kind"], flaw["file"]) == ("missing", "shots")
    assert "has no folder shots; 3 shots" in flaw["text"]


def test_a_repair_that_is_killed_before_the_outcome_is_written_is_finished_by_the_next_one(
    run_dir: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (run_dir / "run.h5").unlink()
    with monkeypatch.context() as killed:
        killed.setattr(repairing, "verify", die)
        with pytest.raises(KeyboardInterrupt):
            list(repairing.repair(run_dir))
    assert RunReader(run_dir).outcome is None
    list(repairing.repair(run_dir))
    reader = RunReader(run_dir)
    assert (reader.outcome, reader.cause) == ("interrupted", "its run.h5 was lost, and with it how the run ended")
    assert [path.name for path in run_dir.parent.iterdir()] == [run_dir.name]


def die(*_: object) -> None:
    raise KeyboardInterrupt


def test_a_stray_copy_is_no_shot_of_a_run_whose_header_was_lost(
    run_dir: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (run_dir / "run.h5").unlink()
    shutil.copy(run_dir / "shots" / "2.h5", run_dir / "shots" / "77.h5")
    assert told(capsys, "repair", run_dir)["sound"], "shots 3 to 77 are not missing"
    assert RunReader(run_dir).shot_count == 3


def test_a_lost_header_is_never_that_of_a_stranger_among_the_shots(run_dir: Path) -> None:
    (run_dir / "run.h5").unlink()
    of_another_run(run_dir)
    shot(run_dir, 1).rename(shot(run_dir, 0))
    list(repairing.repair(run_dir))
    assert RunReader(run_dir).header.run_id == run_dir.name
    assert [path.name for path in (run_dir / "shots").iterdir()] == ["2.h5"]


def test_a_lost_header_of_a_renamed_run_is_what_most_of_its_first_shots_tell(run_dir: Path) -> None:
    (run_dir / "run.h5").unlink()
    of_another_run(run_dir)
    shot(run_dir, 0).rename(shot(run_dir, 3))
    shot(run_dir, 1).rename(shot(run_dir, 0))
    renamed = run_dir.rename(run_dir.with_name("renamed"))
    said = list(repairing.repair(renamed))
    assert RunReader(renamed).header.run_id == HEADER.run_id
    assert f"as run {HEADER.run_id}, which most of the first 100 name: none of these names renamed;" in said[0]


def test_no_more_shots_than_the_first_are_asked_whose_they_are(run_dir: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (run_dir / "run.h5").unlink()
    of_another_run(run_dir)
    shot(run_dir, 1).rename(shot(run_dir, 0))
    monkeypatch.setattr(verification, "ASKED_SHOTS", 1)
    list(repairing.repair(run_dir))
    assert RunReader(run_dir).header.run_id != HEADER.run_id


def test_a_lost_header_does_not_take_the_place_of_an_outcome_that_the_disk_had_refused(run_dir: Path) -> None:
    (run_dir / "run.h5").unlink()
    write_note(run_dir, RunClosing("failed", "the disk was full", "2026-11-22T10:16:00+00:00"))
    list(repairing.repair(run_dir))
    assert (RunReader(run_dir).outcome, RunReader(run_dir).cause) == ("failed", "the disk was full")


def test_a_lost_header_is_written_anew_from_the_shots_and_what_is_lost_is_named(
    run_dir: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (run_dir / "run.h5").write_bytes(b"nonsense")
    for path in (*(run_dir / "shots").iterdir(), run_dir / "shots"):
        os.utime(path, (1.8e9, 1.8e9))
    flaw = told(capsys, "verify", run_dir, status=1)["runs"][0]["flaws"][0]
    assert flaw["kind"] == "unreadable"
    assert flaw["text"].endswith(f"tomoshadow repair {run_dir} writes it anew from the shots, where one can be read")
    done = told(capsys, "repair", run_dir)["done"]
    assert done[0] == f"run.h5 is set aside as {run_dir / 'set-aside' / 'run.h5'}"
    assert "plan, configuration" in done[1]
    reader = RunReader(run_dir)
    lost: dict[str, Any] = {"plan": None, "configuration": {}, "devices": {}, "software": {}}
    lost |= {"calibration_id": None, "calibration_sha256": None, "created_utc": reader.header.created_utc}
    assert reader.header == HEADER.model_copy(update=lost)
    assert (reader.outcome, reader.cause) == ("interrupted", "its run.h5 was lost, and with it how the run ended")
    assert reader.ended_utc == "2027-01-15T08:00:00+00:00"
    assert_same(reader.read_shot(2), shot_of(HEADER, 2))
    with h5py.File(run_dir / "run.h5") as file:
        np.testing.assert_array_equal(file["/shots/sequence"], [40, 41, 42])


def test_without_a_shot_a_lost_header_stays_lost(run_dir: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (run_dir / "run.h5").unlink()
    for path in (run_dir / "shots").iterdir():
        path.unlink()
    assert "no shot is left that tells what it was" in refused(capsys, "repair", run_dir)


def test_a_run_that_is_being_recorded_is_not_repaired(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with RunWriter(tmp_path / "run", HEADER) as writer:
        writer.write_shot(shot_of(HEADER, 0))
        assert told(capsys, "verify", tmp_path / "run", status=1)["runs"][0]["flaws"][0]["kind"] == "being_written"
        error = told(capsys, "repair", tmp_path / "run", status=1)["error"]
        assert "is being written by a living process" in error
        writer.finish("completed")
    assert RunReader(tmp_path / "run").outcome == "completed"


@pytest.mark.parametrize("command", ["verify", "repair"])
def test_what_is_no_run_is_bad_input(tmp_path: Path, capsys: pytest.CaptureFixture[str], command: str) -> None:
    assert "no run, it has neither run.h5 nor shots" in refused(capsys, command, tmp_path)
    assert "no run" in refused(capsys, command, tmp_path / "nowhere")


def test_several_runs_are_verified_at_once_and_one_flaw_is_enough(
    run_dir: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(run_dir, run_dir.parent / "copy")
    truncated(run_dir.parent / "copy")
    found = told(capsys, "verify", run_dir, run_dir.parent / "copy", status=1)
    assert [one["sound"] for one in found["runs"]] == [True, False]


def test_a_run_is_packed_into_one_file(run_dir: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = run_dir.parent / "packed.h5"
    assert told(capsys, "pack", run_dir, "-o", out)["shots"] == 3
    with h5py.File(out) as packed:
        np.testing.assert_array_equal(packed["/shots/sequence"], [40, 41, 42])
    assert "only --overwrite replaces it" in refused(capsys, "pack", run_dir, "-o", out)
    truncated(run_dir)
    assert "1.h5: cannot be read" in refused(capsys, "pack", run_dir, "-o", out, "--overwrite")
    with h5py.File(out) as packed:
        assert packed["/shots/index"].shape == (3,)


@pytest.mark.parametrize("name", ["007.h5", "٣.h5", "99999999999.h5"])
def test_a_copy_whose_name_is_no_number_of_a_shot_opens_no_slots(
    run_dir: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    shutil.copy(shot(run_dir, 1), run_dir / "shots" / name)
    assert RunReader(run_dir).shot_count == 3
    (found,) = told(capsys, "verify", run_dir, status=1)["runs"]
    assert [(flaw["kind"], flaw["file"]) for flaw in found["flaws"]] == [("foreign", f"shots/{name}")]
    assert told(capsys, "repair", run_dir)["sound"]


def a_folder(path: Path) -> None:
    (path / "kept").mkdir(parents=True)


def a_dead_link(path: Path) -> None:
    path.symlink_to("nowhere")


@pytest.mark.parametrize("put", [a_folder, a_dead_link])
@pytest.mark.parametrize(("name", "lost"), [("1.h5", ["missing"]), ("3.h5", [])])
def test_what_stands_in_the_place_of_a_shot_and_is_no_file_is_set_aside(
    run_dir: Path, capsys: pytest.CaptureFixture[str], put: Callable[[Path], None], name: str, lost: list[str]
) -> None:
    path = run_dir / "shots" / name
    path.unlink(missing_ok=True)
    put(path)
    (found,) = told(capsys, "verify", run_dir, status=1).get("runs", [{"flaws": []}])
    assert [flaw["kind"] for flaw in found["flaws"] if flaw["file"] == f"shots/{name}"] == [*lost, "foreign"]
    after = told(capsys, "repair", run_dir, status=1 if lost else 0)
    assert [flaw["kind"] for flaw in after["flaws"]] == lost
    assert (run_dir / "set-aside" / name).lstat()


def test_a_run_that_is_being_recorded_is_not_packed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "half.h5"
    with RunWriter(tmp_path / HEADER.run_id, HEADER) as writer:
        writer.write_shot(shot_of(HEADER, 0))
        main(["pack", str(tmp_path / HEADER.run_id), "-o", str(out)])
        assert "is being written by a living process" in capsys.readouterr().err
    assert not out.exists()
    told(capsys, "pack", tmp_path / HEADER.run_id, "-o", out)


@pytest.mark.skipif(not unshare_works(), reason="this machine forbids user namespaces")
def test_a_full_disk_is_not_taken_for_a_torn_shot_when_a_run_is_packed(run_dir: Path, tmp_path: Path) -> None:
    (tmp_path / "disk").mkdir()
    mount = 'mount -t tmpfs -o size=48k tomoshadow "$1/disk" &&'
    command = f'{mount} exec "$2" -m server.cli pack "$3" -o "$1/disk/x.h5"'
    process = subprocess.run(
        ["unshare", "-rm", "sh", "-c", command, "sh", str(tmp_path), sys.executable, str(run_dir)],
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
        cwd=Path(__file__).parents[3],
    )
    assert "bytes left, and the packed run takes up to" in process.stderr
