"""Calibration files come back exactly, are never overwritten by accident, and are checked when read."""

import errno
import json
import os
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from processing.calibration.calibrate import calibrate
from processing.calibration.calibration import Calibration
from processing.calibration.calibration_file import file_sha256, load_calibration, save_calibration
from processing.calibration.calibration_record import content_id, json_id
from processing.calibration.errors import CalibrationError
from processing.calibration.observation import PlaneObservation
from tests.processing.calibration.fit.test_free_pose import boards
from tests.support.calibration_cases import TARGET, calibration_set, paper_camera, seen_planes, volume_points_mm

Change = Callable[[Any], None]
MODELS = ["pinhole", "pinhole_tilted", "polynomial"]
OLD_FILES = sorted(Path(__file__).parents[2].glob("fixtures/v*/runs/calibrations/*.json"))


def make(model: str = "pinhole", created_utc: str = "2026-01-02T03:04:05+00:00", noise_px: float = 0.05) -> Calibration:
    planes = seen_planes(paper_camera(), z_mm=(-3.0, -1.0, 1.0, 3.0), noise_px=noise_px)
    return calibrate(calibration_set(left=planes), model=model, created_utc=created_utc)


@pytest.fixture(scope="module")
def calibration() -> Calibration:
    return make()


@pytest.mark.parametrize("model", MODELS)
def test_round_trip_is_exact(tmp_path: Path, model: str) -> None:
    written = make(model)
    save_calibration(written, tmp_path / "a.json")
    read = load_calibration(tmp_path / "a.json")
    points_mm = volume_points_mm(200)
    np.testing.assert_array_equal(
        read.views["left"].mapping.project(points_mm), written.views["left"].mapping.project(points_mm)
    )
    assert read.target == TARGET
    for name in ("id", "created_utc", "source", "z_range_mm", "x_range_mm", "y_range_mm", "notes"):
        assert getattr(read, name) == getattr(written, name)
    for name in ("model", "verdict", "n_points", "mean_error_px", "holdout_error_px", "planes", "extent_mm"):
        assert getattr(read.views["left"], name) == getattr(written.views["left"], name)
    save_calibration(read, tmp_path / "b.json")
    assert file_sha256(tmp_path / "a.json") == file_sha256(tmp_path / "b.json")


@pytest.mark.parametrize("old", OLD_FILES, ids=lambda path: f"{path.parents[2].name}-{path.stem}")
def test_old_files_are_written_again_as_they_stand(tmp_path: Path, old: Path) -> None:
    save_calibration(load_calibration(old), tmp_path / "again.json")
    old_text, again_text = (_without_versions(path) for path in (old, tmp_path / "again.json"))
    assert again_text == old_text


def _without_versions(path: Path) -> str:
    return re.sub(r'"software": \{[^}]*\}', "", path.read_text())


def test_what_could_not_be_read_again_gets_no_id(calibration: Calibration) -> None:
    broken = replace(calibration.views["left"], rms_px=float("nan"))
    with pytest.raises(ValueError, match=r"views\.left\.rms_px"):
        content_id(replace(calibration, views={"left": broken}))


def test_boards_in_free_poses_come_back(tmp_path: Path) -> None:
    written = calibrate(calibration_set(only=tuple(boards())))
    save_calibration(written, tmp_path / "c.json")
    read = load_calibration(tmp_path / "c.json").views["only"]
    assert read.intrinsics_only
    for pose, other in zip(read.boards_in_free_poses, written.views["only"].boards_in_free_poses, strict=True):
        np.testing.assert_array_equal(pose.rotation, other.rotation)
    assert read.planes[0].z_mm is None


def test_same_content_has_the_same_id_at_any_time(calibration: Calibration) -> None:
    assert make(created_utc="2030-01-01T00:00:00+00:00").id == calibration.id
    assert make(noise_px=0.06).id != calibration.id


def test_a_disk_without_hard_links_is_no_matter(
    tmp_path: Path, calibration: Calibration, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(source: Path, target: Path) -> None:
        raise PermissionError(errno.EPERM, "Operation not permitted", str(source), None, str(target))

    monkeypatch.setattr(os, "link", refuse)
    save_calibration(calibration, tmp_path / "c.json")
    assert load_calibration(tmp_path / "c.json").id == calibration.id
    before = (tmp_path / "c.json").read_bytes()
    with pytest.raises(CalibrationError, match="not overwritten"):
        save_calibration(make(noise_px=0.06), tmp_path / "c.json")
    assert (tmp_path / "c.json").read_bytes() == before
    assert [file.name for file in tmp_path.iterdir()] == ["c.json"]


def test_a_person_can_read_it(tmp_path: Path, calibration: Calibration) -> None:
    save_calibration(calibration, tmp_path / "c.json")
    text = (tmp_path / "c.json").read_text()
    content = json.loads(text)
    assert content["schema"] == "tomoshadow.calibration"
    assert "right-handed" in content["axes"]
    assert content["views"]["left"]["planes"][0]["z_mm"] == -3.0
    assert max(len(line) for line in text.splitlines()) < 240
    assert 40 < len(text.splitlines()) < 150


def test_an_existing_file_is_replaced_only_on_request(tmp_path: Path, calibration: Calibration) -> None:
    path = tmp_path / "c.json"
    path.write_text("precious")
    with pytest.raises(CalibrationError, match=r"c\.json: exists"):
        save_calibration(calibration, path)
    assert path.read_text() == "precious"
    save_calibration(calibration, path, overwrite=True)
    assert load_calibration(path).id == calibration.id
    assert [file.name for file in tmp_path.iterdir()] == ["c.json"]


def _set(key: tuple[str | int, ...], value: Any) -> Change:
    def change(content: Any) -> None:
        *path, last = key
        for part in path:
            content = content[part]
        content[last] = value

    return change


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (_set(("version",), 2), "version: 2, this program reads 1"),
        (_set(("schema",), "other"), "schema: not a calibration file"),
        (_set(("views", "left", "planes", 1, "z_mm"), "far"), r"views\.left\.planes\.1\.z_mm: "),
        (_set(("views", "left", "mapping", "focus"), 3), r"views\.left\.mapping\.pinhole\.focus: Extra"),
        (_set(("views", "left", "focus"), 3), r"views\.left\.focus: Extra"),
        (_set(("views", "left", "covariance", "parameters"), ["one"]), r"views\.left\.covariance: .* one row and"),
        (_set(("views", "left", "mean_error_px"), -1.0), r"views\.left\.mean_error_px: "),
        (_set(("views", "left", "planes", 0, "max_error_px"), -1.0), r"views\.left\.planes\.0\.max_error_px: "),
        (_set(("views",), {}), "views: "),
        (_set(("z_range_mm",), [0.0, 9.0]), "id: cal-.* does not belong to this content"),
    ],
)
def test_damaged_files_are_refused_by_field(
    tmp_path: Path, calibration: Calibration, change: Change, complaint: str
) -> None:
    path = tmp_path / "c.json"
    save_calibration(calibration, path)
    content = json.loads(path.read_text())
    change(content)
    path.write_text(json.dumps(content))
    with pytest.raises(CalibrationError, match=rf"c\.json: {complaint}"):
        load_calibration(path)


@pytest.mark.parametrize("text", ["", "{", "[1, 2]", "null"])
def test_other_files_are_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "c.json").write_text(text)
    with pytest.raises(CalibrationError, match=r"c\.json: "):
        load_calibration(tmp_path / "c.json")


def test_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(CalibrationError, match=r"none\.json: No such file"):
        load_calibration(tmp_path / "none.json")


def test_scattered_points_have_no_plane(tmp_path: Path) -> None:
    camera, points_mm = paper_camera(), volume_points_mm(60)
    scattered = (PlaneObservation("table", points_mm, camera.project(points_mm)),)
    save_calibration(calibrate(calibration_set(only=scattered)), tmp_path / "c.json")
    assert load_calibration(tmp_path / "c.json").views["only"].planes[0].z_mm is None


def test_files_from_before_a_field_existed_still_load(tmp_path: Path, calibration: Calibration) -> None:
    path = tmp_path / "c.json"
    save_calibration(calibration, path)
    content = json.loads(path.read_text())
    del content["target"]["y_axis"]
    for plane in content["views"]["left"]["planes"]:
        del plane["max_error_px"], plane["holdout_error_px"]
    content["id"] = json_id(content)
    path.write_text(json.dumps(content))
    old = load_calibration(path)
    assert old.target == TARGET
    assert old.id == content["id"] != calibration.id
    assert {plane.max_error_px for plane in old.views["left"].planes} == {None}
    save_calibration(old, tmp_path / "again.json")
    again = json.loads((tmp_path / "again.json").read_text())
    assert again["views"]["left"]["planes"] == content["views"]["left"]["planes"]
