"""Flipped bits in what a run says of itself: they are told, never believed, and hold up nobody."""

import shutil
from pathlib import Path

import pytest

from daq.errors import ShotFileError
from daq.files.header import RunClosing
from daq.files.run_directory import RunReader
from daq.files.run_file import add_closing
from daq.files.shot_file import read_formats
from daq.files.text_heap import has_whole_heaps
from tests.support.droplet_run import write_run

OLD_RUN = next((Path(__file__).parents[2] / "fixtures" / "v0.1.0" / "runs").glob("*-interrupted"))
HEAP = b"GCOL\x01"


@pytest.fixture(scope="module")
def run_dir(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_run(tmp_path_factory.mktemp("runs") / "run")


def told(run_dir: Path) -> tuple[object, ...]:
    run = RunReader(run_dir)
    return run.header, run.closing, run.shot_count


def heaps_of(content: bytes) -> list[tuple[int, int]]:
    """First byte and length of every heap."""
    starts = [at for at in range(len(content)) if content.startswith(HEAP, at)]
    return [(at, int.from_bytes(content[at + 8 : at + 16], "little")) for at in starts]


def test_a_flipped_bit_is_told_or_changes_nothing(run_dir: Path) -> None:
    path = run_dir / "run.h5"
    sound, before = path.read_bytes(), told(run_dir)
    heaps = heaps_of(sound)
    assert len(heaps) >= 2
    places = [at + offset for at, length in heaps for offset in range(0, length, 29)]
    refused = 0
    try:
        for number, place in enumerate(places):
            damaged = bytearray(sound)
            damaged[place] ^= 1 << number % 8
            path.write_bytes(damaged)
            try:
                assert told(run_dir) == before, place
            except ShotFileError:
                refused += 1
    finally:
        path.write_bytes(sound)
    assert refused > len(places) / 20


def test_a_chain_that_stands_still_or_leads_beyond_its_heap_is_broken(run_dir: Path, tmp_path: Path) -> None:
    sound = (run_dir / "run.h5").read_bytes()
    at, length = heaps_of(sound)[0]
    copy = tmp_path / "copy.h5"
    copy.write_bytes(sound)
    assert has_whole_heaps(copy)
    for name, place, change in (
        ("no number and no length", at + 16, bytes(16)),
        ("a length of all the file", at + 24, (len(sound)).to_bytes(8, "little")),
        ("a heap longer than the file", at + 8, (2 * len(sound)).to_bytes(8, "little")),
        ("a heap shorter than its own head", at + 8, bytes(8)),
    ):
        broken = tmp_path / f"{name}.h5"
        broken.write_bytes(sound[:place] + change + sound[place + len(change) :])
        assert not has_whole_heaps(broken), (name, length)


def test_an_outcome_that_was_changed_is_not_believed(run_dir: Path, tmp_path: Path) -> None:
    other = write_run(tmp_path / "other")
    path = other / "run.h5"
    text = path.read_bytes()
    assert text.count(b"completed") == 1
    path.write_bytes(text.replace(b"completed", b"comqleted"))
    with pytest.raises(ShotFileError, match=r"its outcome is not what was written: copy it back from a backup"):
        _ = RunReader(other).outcome
    assert RunReader(run_dir).closing == RunClosing("completed", "", RunReader(run_dir).ended_utc)
    with pytest.raises(Exception, match="has an outcome already"):
        add_closing(run_dir, RunClosing("failed", "", ""))


def test_no_flipped_bit_in_the_texts_of_an_old_shot_is_read_for_ever(tmp_path: Path) -> None:
    """Each is read in a second; HDF5 alone never comes back from some of them."""
    run_dir = Path(shutil.copytree(OLD_RUN, tmp_path / "run"))
    path = run_dir / "shots" / "0.h5"
    sound = path.read_bytes()
    assert len(heaps_of(sound)) >= 1
    places = [at + offset for at, length in heaps_of(sound) for offset in range(0, length, 61)]
    whole, refused = RunReader(run_dir).read_shot(0), 0
    for number, place in enumerate(places):
        damaged = bytearray(sound)
        damaged[place] ^= 1 << number % 8
        path.write_bytes(damaged)
        try:
            shot = RunReader(run_dir).read_shot(0)
        except ShotFileError:
            refused += 1
        else:
            assert shot.index == whole.index
    assert refused
    broken = bytearray(sound)
    at, _ = heaps_of(sound)[0]
    broken[at + 16 : at + 32] = bytes(16)
    path.write_bytes(broken)
    for read in (lambda: RunReader(run_dir).read_shot(0), lambda: read_formats(path)):
        with pytest.raises(ShotFileError, match="torn or damaged"):
            read()
