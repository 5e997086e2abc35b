"""What exists is replaced if asked for, by what is whole; nothing is lost in between."""

from pathlib import Path

import pytest

from processing.runs.overwriting import OutputExistsError, replacing, require_free


def contents(folder: Path) -> dict[str, str]:
    """Text of every file below a folder, hidden ones too."""
    return {str(file.relative_to(folder)): file.read_text() for file in sorted(folder.rglob("*")) if file.is_file()}


def write_results(folder: Path, text: str) -> None:
    (folder / "run").mkdir(parents=True)
    (folder / "run" / "run.h5").write_text(text)


def test_a_file_is_no_folder_for_results(tmp_path: Path) -> None:
    (tmp_path / "spray.png").write_text("image")
    for overwrite in (True, False):
        with pytest.raises(OutputExistsError, match=r"spray\.png: is a file, no folder for out"):
            require_free(tmp_path / "spray.png" / "out", overwrite=overwrite)


def test_files_take_their_places_together(tmp_path: Path) -> None:
    (tmp_path / "mean.png").write_text("old picture")
    with replacing(tmp_path / "mean.vtkhdf") as out:
        out.write_text("new")
        out.with_name("mean.png").write_text("new picture")
        assert contents(tmp_path)["mean.png"] == "old picture"
    assert contents(tmp_path) == {"mean.vtkhdf": "new", "mean.png": "new picture"}


def test_a_folder_takes_the_place_of_a_folder(tmp_path: Path) -> None:
    write_results(tmp_path / "day", "old")
    (tmp_path / "day" / "more").write_text("old")
    with replacing(tmp_path / "day") as out:
        write_results(out, "new")
    assert contents(tmp_path) == {"day/run/run.h5": "new"}


@pytest.mark.parametrize("error", [OSError("disk full"), KeyboardInterrupt()])
def test_all_stays_as_it_was_where_the_work_ends_half_way(tmp_path: Path, error: BaseException) -> None:
    write_results(tmp_path / "day", "old")
    with pytest.raises(type(error)), replacing(tmp_path / "day") as out:  # noqa: PT012
        write_results(out, "new")
        raise error
    assert contents(tmp_path) == {"day/run/run.h5": "old"}


def test_a_folder_comes_back_where_its_successor_cannot_take_its_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_results(tmp_path / "day", "old")
    rename = Path.rename

    def fails_for_the_new(path: Path, target: Path) -> Path:
        if path.suffix != ".replaced" and target == tmp_path / "day":
            raise OSError("no")
        return rename(path, target)

    monkeypatch.setattr(Path, "rename", fails_for_the_new)
    with pytest.raises(OSError, match="no"), replacing(tmp_path / "day") as out:
        write_results(out, "new")
    assert contents(tmp_path) == {"day/run/run.h5": "old"}


def test_what_is_free_and_what_is_not(tmp_path: Path) -> None:
    made_with = ("run/run.h5",)
    (tmp_path / "empty").mkdir()
    (tmp_path / "file").write_text("kept")
    (tmp_path / "home" / "letters").mkdir(parents=True)
    write_results(tmp_path / "day", "old")
    require_free(tmp_path / "nothing", tmp_path / "empty", overwrite=False)
    require_free(tmp_path / "file", tmp_path / "day", overwrite=True, made_with=made_with)
    for taken in ("file", "home", "day"):
        with pytest.raises(OutputExistsError, match=f"{taken}: exists; only --overwrite replaces it"):
            require_free(tmp_path / taken, overwrite=False, made_with=made_with)
    for stranger in ("home", "day"):
        with pytest.raises(OutputExistsError, match=f"{stranger}: is a folder that this command has not made"):
            require_free(tmp_path / stranger, overwrite=True)
