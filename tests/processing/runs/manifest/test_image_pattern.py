"""Patterns of file names find what they write, and nothing else."""

from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from processing.runs.manifest.image_pattern import ImagePattern


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


@pytest.mark.parametrize(("text", "name"), [("{view}_{shot:03d}.tif", "a_2.tif"), ("{view}_{shot}.tif", "a_001.tif")])
def test_numbers_that_are_padded_otherwise_are_told_and_not_left_out(tmp_path: Path, text: str, name: str) -> None:
    """Of im01 to im14, a number without zeros in front would mean the last five alone."""
    for there in (name, "a_123.tif", "a_x.tif", "b_2.tiff", "b_123.tif"):
        (tmp_path / there).touch()
    with pytest.raises(ValueError, match=f"{name} is there, and is a_"):
        ImagePattern(text).found(tmp_path)
    assert ImagePattern(text).found(tmp_path, ["b"]) == {"b": [123]}


@pytest.mark.parametrize("name", ["day7/a_1_b.TIF", "day7/a_1_B.tif", "Day7/a_1_b.tif"])
def test_capital_letters_are_told_and_their_file_is_not_left_out(tmp_path: Path, name: str) -> None:
    """Where the first shots or the last were written by another program, they would be missing without a word."""
    for there in (name, "day7/a_2_b.tif", "day7/A_3_b.tif", "day7/a_x_b.TIF"):
        (tmp_path / there).parent.mkdir(exist_ok=True)
        (tmp_path / there).touch()
    pattern = ImagePattern("day7/{view}_{shot}_b.tif")
    told = ""
    try:
        pattern.found(tmp_path, ["a"])
    except ValueError as error:
        told = str(error)
    assert f"{name} is there, and is day7/a_1_b.tif by day7/" in told
    assert pattern.found(tmp_path, ["A"]) == {"A": [3]}
    (tmp_path / "day7" / "c_1_b.TIF").touch()
    with pytest.raises(ValueError, match="is there, and is day7/"):
        pattern.found(tmp_path)


@pytest.mark.parametrize("text", ["{view}{shot}.png", "{view}{shot:02d}.png", "{shot:02d}{view}.png"])
def test_a_name_and_a_number_that_touch_are_told_apart_by_names_that_are_known(tmp_path: Path, text: str) -> None:
    """Else left12 is shot 2 of left1."""
    pattern, written = ImagePattern(text), {"left": [1, 2, 12], "2right": [2, 34]}
    for view, shots in written.items():
        for shot in shots:
            (tmp_path / pattern.file(view, shot)).touch()
    assert pattern.found(tmp_path, list(written)) == dict(sorted(written.items()))
    with pytest.raises(ValueError, match="touch, so name the cameras"):
        pattern.found(tmp_path)


def test_without_a_number_a_view_has_one_file(tmp_path: Path) -> None:
    (tmp_path / "cam2.tif").touch()
    pattern = ImagePattern("{view}.tif")
    assert not pattern.counts_shots
    assert pattern.found(tmp_path) == {"cam2": [0]}


@given(st.text(alphabet="{}:viewshot04dx!a", max_size=14))
def test_a_pattern_is_read_or_refused_as_a_value(text: str) -> None:
    with suppress(ValueError):
        assert "cam1" in ImagePattern(text).file("cam1", 5)
