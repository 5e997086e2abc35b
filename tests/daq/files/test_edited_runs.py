"""A run that was edited after it was written says so: its numbers, its references, its view of all shots."""

import shutil
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from daq.errors import ShotFileError
from daq.files.columns import columns_of, crc32_of
from daq.files.repair import repair
from daq.files.run_directory import RunReader, RunWriter, pack
from daq.files.verification import FlawKind, verify
from tests.daq.files.test_run_directory import FORMATS, header_of, shot_of

REFERENCES = {name: np.full((2, *view.shape), 7, np.float32) for name, view in FORMATS.items()}
Edit = Callable[[h5py.File], None]


@pytest.fixture
def run_dir(tmp_path: Path) -> Path:
    path = tmp_path / "20261122T101530-spray"
    with RunWriter(path, header_of()) as writer:
        writer.write_references(REFERENCES, REFERENCES)
        for index in range(2):
            writer.write_shot(shot_of(header_of(), index))
        writer.finish("completed")
    return path


def edited(path: Path, edit: Edit) -> None:
    with h5py.File(path, "r+") as file:
        edit(file)


def exchange(file: h5py.File, one: str, other: str) -> None:
    file.move(one, "away")
    file.move(other, one)
    file.move("away", other)


def columns_in(path: Path) -> list[str]:
    names: list[str] = []
    with h5py.File(path) as file:
        file.visititems(lambda name, item: names.append(name) if isinstance(item, h5py.Dataset) else None)
    return names


def changed(name: str) -> Edit:
    def edit(file: h5py.File) -> None:
        values = file[name][()]
        file[name][()] = ~values if values.dtype == bool else np.nan_to_num(values) + 1

    return edit


def test_no_number_of_a_shot_is_changed_unseen(run_dir: Path) -> None:
    assert verify(run_dir).sound
    path = run_dir / "shots" / "1.h5"
    written, unseen = path.read_bytes(), []
    for name in columns_in(path):
        edited(path, changed(name))
        flaws = verify(run_dir).flaws
        unseen += [] if [flaw.file for flaw in flaws] == ["shots/1.h5"] else [name]
        path.write_bytes(written)
    assert unseen == []


@pytest.mark.parametrize(
    "edit",
    [
        lambda file: exchange(file, "cameras/view1", "cameras/view2"),
        lambda file: file.attrs.modify("schema_version", 1),
    ],
    ids=["views exchanged", "an older version"],
)
def test_numbers_stay_those_of_their_view_and_version(tmp_path: Path, edit: Edit) -> None:
    header = header_of({"view1": FORMATS["view1"], "view2": FORMATS["view1"]})
    with RunWriter(tmp_path / "run", header) as writer:
        writer.write_shot(replace(shot_of(header, 0), refires=1))
    edited(tmp_path / "run" / "shots" / "0.h5", edit)
    told = [flaw.kind for flaw in verify(tmp_path / "run").flaws if flaw.file == "shots/0.h5"]
    assert told == [FlawKind.DAMAGED]


def test_bits_of_a_shot_are_those_of_its_run(run_dir: Path) -> None:
    """Whoever reads a shot without its run takes its grey values by them."""
    edited(run_dir / "shots" / "1.h5", lambda file: file["cameras/view2/frames"].attrs.modify("significant_bits", 9))
    flaws = verify(run_dir).flaws
    assert [(flaw.kind, flaw.file) for flaw in flaws] == [(FlawKind.DAMAGED, "shots/1.h5")]
    assert "frames of view2 have 9 significant bits" in flaws[0].text


def test_a_shot_that_tells_no_bits_is_read(run_dir: Path) -> None:
    edited(run_dir / "shots" / "0.h5", lambda file: file["cameras/view2/frames"].attrs.pop("significant_bits"))
    edited(run_dir / "run.h5", lambda file: file["cameras/view2/frames"].attrs.pop("significant_bits"))
    assert verify(run_dir).sound


def test_a_shot_from_before_it_had_a_checksum_of_its_numbers_is_read(run_dir: Path) -> None:
    for index in range(2):
        edited(run_dir / "shots" / f"{index}.h5", lambda file: file.attrs.pop("columns_crc32"))
    assert verify(run_dir).sound


def test_a_reference_that_was_changed_is_told(run_dir: Path) -> None:
    edited(run_dir / "run.h5", changed("cameras/view2/background"))
    assert [(flaw.kind, flaw.file) for flaw in verify(run_dir).flaws] == [(FlawKind.DAMAGED, "run.h5")]
    with pytest.raises(ShotFileError, match="background of view2 is not what was written"):
        RunReader(run_dir).background("view2")


def test_a_reference_of_one_view_that_was_removed_is_told(run_dir: Path) -> None:
    edited(run_dir / "run.h5", lambda file: file.__delitem__("cameras/view2/background"))
    (flaw,) = verify(run_dir).flaws
    assert "no background of view2, and one of view1" in flaw.text


def test_a_flipped_bit_of_a_reference_is_found_by_who_verifies(run_dir: Path) -> None:
    with h5py.File(run_dir / "run.h5") as file:
        chunk = file["cameras/view1/dark"].id.get_chunk_info(1)
    content = bytearray((run_dir / "run.h5").read_bytes())
    content[chunk.byte_offset + chunk.size // 2] ^= 0x10
    (run_dir / "run.h5").write_bytes(content)
    assert [(flaw.kind, flaw.file) for flaw in verify(run_dir).flaws] == [(FlawKind.DAMAGED, "run.h5")]


def replaced(file: h5py.File) -> None:
    values = file["cameras/view1/pulse_current_a"][()]
    del file["cameras/view1/pulse_current_a"]
    file["cameras/view1/pulse_current_a"] = values + 1


@pytest.mark.parametrize(
    ("edit", "what"),
    [
        (lambda file: exchange(file, "cameras/view1", "cameras/view2"), "/cameras/view1/"),
        (replaced, "/cameras/view1/pulse_current_a"),
        (lambda file: file["cameras/view2/frames"].attrs.modify("significant_bits", 9), "view2 have 9 sig"),
        (lambda file: file["entry/start_time"].write_direct(np.array("1999", object)), "start_time"),
    ],
    ids=["views exchanged", "numbers of its own", "bits", "a time of NeXus"],
)
def test_what_other_programs_see_is_what_the_shots_hold(run_dir: Path, edit: Edit, what: str) -> None:
    edited(run_dir / "run.h5", edit)
    (flaw, *_) = verify(run_dir).flaws
    assert (flaw.kind, flaw.file) == (FlawKind.DAMAGED, "run.h5")
    assert what in flaw.text


@pytest.mark.parametrize("name", ["20261123T080000-other", "same"])
def test_the_run_file_of_another_run_is_the_stranger_and_not_all_the_shots(
    run_dir: Path, tmp_path: Path, name: str
) -> None:
    if name == "same":
        run_dir = run_dir.rename(tmp_path / "run")
    run_id = header_of().run_id if name == "same" else name
    other = header_of().model_copy(update={"run_id": run_id, "created_utc": "2026-11-23T08:00:00+00:00"})
    with RunWriter(tmp_path / other.run_id, other) as writer:
        writer.write_shot(shot_of(other, 0))
        writer.finish("completed")
    shutil.copy(tmp_path / other.run_id / "run.h5", run_dir / "run.h5")
    flaws = [(flaw.kind, flaw.file) for flaw in verify(run_dir).flaws]
    told = list(repair(run_dir))
    assert sorted(path.name for path in (run_dir / "shots").iterdir()) == ["0.h5", "1.h5"], told
    assert flaws == [(FlawKind.FOREIGN, "run.h5")]
    assert RunReader(run_dir).header.created_utc == header_of().created_utc
    assert verify(run_dir).sound
    assert any("run.h5 is set aside" in step for step in told)


def test_a_shot_of_another_run_of_the_same_name_is_foreign(run_dir: Path, tmp_path: Path) -> None:
    """Imports are named by their folder: two of them, of two days, may have one name."""
    other = header_of().model_copy(update={"created_utc": "2026-11-23T08:00:00+00:00"})
    with RunWriter(tmp_path / "other", other) as writer:
        for index in range(2):
            writer.write_shot(shot_of(other, index, seed=1))
    shutil.copy(tmp_path / "other" / "shots" / "1.h5", run_dir / "shots" / "1.h5")
    assert [(flaw.kind, flaw.file) for flaw in verify(run_dir).flaws] == [(FlawKind.FOREIGN, "shots/1.h5")]
    with pytest.raises(ShotFileError, match=r"of another run of this name, which began at 2026-11-23T08:00:00\+00:00"):
        RunReader(run_dir).read_shot(1)


def test_a_lost_header_gets_the_time_of_its_run_back(run_dir: Path) -> None:
    (run_dir / "run.h5").unlink()
    list(repair(run_dir))
    assert RunReader(run_dir).header.created_utc == header_of().created_utc
    assert verify(run_dir).sound


@pytest.mark.parametrize("damage", ["exchanged", "edited"])
def test_what_is_not_as_it_was_written_is_not_packed(run_dir: Path, tmp_path: Path, damage: str) -> None:
    one, other = (run_dir / "shots" / f"{index}.h5" for index in range(2))
    if damage == "exchanged":
        shutil.move(one, tmp_path / "away")
        shutil.move(other, one)
        shutil.move(tmp_path / "away", other)
    else:
        edited(other, lambda file: file["cameras/view1/frames"].write_direct(np.zeros((1, 2, 12, 16), "u1")))
    with pytest.raises(ShotFileError, match=r"\.h5: (holds shot 1|exposure A of view1: damaged)"):
        pack(run_dir, tmp_path / "packed.h5")
    assert not (tmp_path / "packed.h5").exists()


def test_a_shot_of_an_older_version_is_sound_with_the_columns_it_has(tmp_path: Path) -> None:
    """Its checksum is that of those columns, whatever this program knows besides."""
    header = header_of()
    with RunWriter(tmp_path / "run", header) as writer:
        writer.write_shot(shot_of(header, 0))
        writer.finish("completed")
    old, new = columns_of(header, version=1), columns_of(header)
    with h5py.File(tmp_path / "run" / "shots" / "0.h5", "r+") as file:
        for name in new.keys() - old.keys():
            del file[name]
        file.attrs.modify("schema_version", 1)
        check = crc32_of(header.run_id, {name: file[name][0] for name in old})
        file.attrs.modify("columns_crc32", np.uint32(check))
    assert [flaw.text for flaw in verify(tmp_path / "run").flaws] == []
    assert RunReader(tmp_path / "run").read_shot(0).refires == 0


def test_a_shot_of_a_newer_program_is_called_so(run_dir: Path) -> None:
    edited(run_dir / "shots" / "1.h5", lambda file: file.attrs.modify("schema_version", 3))
    told = [flaw.text for flaw in verify(run_dir).flaws]
    assert [text.partition("1.h5: ")[2] for text in told] == ["version 3, this program reads 2: take a newer one"]


@pytest.mark.parametrize("name", ["dark", "background"])
def test_a_run_whose_references_are_not_what_was_written_is_not_packed(run_dir: Path, name: str) -> None:
    """Other programs read the packed file, and compare no checksums: they would divide by another background."""
    edited(run_dir / "run.h5", changed(f"cameras/view1/{name}"))
    out = run_dir.parent / "packed.h5"
    with suppress(ShotFileError):
        pack(run_dir, out)
    assert not out.exists()
