"""Patterns of file names find what they write, and nothing else."""

from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from processing.runs.image_pattern import ImagePattern


@pytest.mark.parametrize(
    "text", ["{view}/im{shot:04d}_a.tif", "{view}_{shot}.png", "{shot:03}/{view}/{view}-{shot}[1].tif"]
)
def test_what_is_written_is_found(tmp_path: Path, text: str) -> None:
    pattern = ImagePattern(text)
    written = {"cam1": [0, 7, 12345], "top.left-2": [3]}
    for view, shots in written.items():
        for shot in shots:
            file = tmp_path / pattern.file(view, shot)
            file.parent.mkdir(parents=True, exist_ok=True)
            file.touch()
    (tmp_path / "notes_1.txt").touch()
    assert pattern.found(tmp_path) == written


def test_numbers_that_are_padded_otherwise_are_other_files(tmp_path: Path) -> None:
    for name in ("a_001.tif", "a_2.tif", "a_x.tif", "a_0003.tif", "b_2.tiff"):
        (tmp_path / name).touch()
    assert ImagePattern("{view}_{shot:03d}.tif").found(tmp_path) == {"a": [1]}
    assert ImagePattern("{view}_{shot}.tif").found(tmp_path) == {"a": [2]}


def test_without_a_number_a_view_has_one_file(tmp_path: Path) -> None:
    (tmp_path / "cam2.tif").touch()
    pattern = ImagePattern("{view}.tif")
    assert not pattern.counts_shots
    assert pattern.found(tmp_path) == {"cam2": [0]}


@given(st.text(alphabet="{}:viewshot04dx!a", max_size=14))
def test_a_pattern_is_read_or_refused_as_a_value(text: str) -> None:
    with suppress(ValueError):
        assert "cam1" in ImagePattern(text).file("cam1", 5)
