"""Files that appear whole or not at all."""

from pathlib import Path

import pytest

from daq.files.atomic_file import own_part_path, replacing


def test_a_disk_that_is_full_is_told_with_the_file(tmp_path: Path) -> None:
    path = tmp_path / "shot.csv"
    path.write_text("old")
    with pytest.raises(OSError, match=r"No space left on device.*shot\.csv"), replacing(path) as part:  # noqa: PT012
        part.symlink_to("/dev/full")
        part.write_text("new")
    assert [(file.name, file.read_text()) for file in tmp_path.iterdir()] == [("shot.csv", "old")]


def test_errors_that_name_a_file_stay_as_they_are(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="elsewhere"), replacing(tmp_path / "shot.csv"):
        (tmp_path / "elsewhere").read_text()


def test_two_who_write_one_file_at_a_time_both_bring_it_to_its_end(tmp_path: Path) -> None:
    """A worker that was cut off goes on with what another one has begun meanwhile."""
    path = tmp_path / "shot.h5"
    with replacing(path, own_part_path(path)) as first:
        first.write_text("the first")
        with replacing(path, own_part_path(path)) as second:
            second.write_text("the second")
        assert path.read_text() == "the second"
    assert [(file.name, file.read_text()) for file in tmp_path.iterdir()] == [("shot.h5", "the first")]
