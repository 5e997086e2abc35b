"""``tomoshadow import``: all or nothing."""

from pathlib import Path

import pytest

from tests.support.calibration_points import write_points
from tests.support.command_line import refused, shown


def test_a_manifest_with_a_missing_image_writes_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    manifest = tmp_path / "manifest.toml"
    manifest.write_text('[run]\npolarity = "bright"\n\n[[run.shot]]\nframe_a = { left = "a.png", right = "b.png" }\n')
    message = refused(capsys, "import", manifest, "-o", tmp_path / "out")
    assert f"{manifest}, line 5: " in message
    assert "a.png" in message
    assert sorted(path.name for path in tmp_path.iterdir()) == ["manifest.toml"]


def test_an_import_never_overwrites(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "precious").write_text("kept")
    manifest = tmp_path / "manifest.toml"
    manifest.write_text('[run]\npolarity = "bright"\n')
    assert refused(capsys, "import", manifest, "-o", tmp_path / "out")
    assert (tmp_path / "out" / "precious").read_text() == "kept"


def test_people_are_told_what_was_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_points(tmp_path)
    text = shown(capsys, "import", tmp_path / "manifest.toml", "-o", tmp_path / "set")
    assert text == f"cameras: view1\ncalibration set: {tmp_path / 'set' / 'calibration'}, 0 planes\n"
