"""Mistakes of a calibration set that every view fits perfectly: none of them ends as good, and right sets do."""

import json
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

import tomoshadow
from processing.geometry import FloatArray, PinholeCamera, view_camera
from server.cli.main import main
from tests.support.command_line import told

AZIMUTHS_DEG = {"cam0": -30.0, "cam1": -15.0, "cam2": 15.0}
COLUMNS = ["u_px", "v_px", "x_mm", "y_mm", "z_mm"]
STATED = (
    'azimuth_deg = { cam0 = -30, cam1 = -15, cam2 = 15 }\nscale_px_per_mm = 25\nunit = "mm"\n',
    'pixel_origin = 0\nv_axis = "down"\n',
)
AZIMUTHS = "azimuth_deg = { cam0 = -30, cam1 = -15, cam2 = 15 }\n"
Mistake = Callable[[FloatArray, str], FloatArray]


def camera(name: str) -> PinholeCamera:
    return view_camera(
        AZIMUTHS_DEG[name], focal_length_mm=35.0, magnification=0.4, scale_px_per_mm=25.0, image_size_px=(320, 240)
    )


def table(name: str, noise_px: float = 0.02) -> FloatArray:
    """Rows u, v, x, y, z of 63 points on three planes as a true camera sees them."""
    x_mm, y_mm, z_mm = np.meshgrid(np.linspace(-4, 4, 9), np.linspace(-3, 3, 7), [-3.0, 0.0, 3.0])
    points_mm = np.column_stack([x_mm.ravel(), y_mm.ravel(), z_mm.ravel()])
    seen_px = camera(name).project(points_mm)
    seen_px += np.random.default_rng(len(name)).normal(0, noise_px, seen_px.shape)
    return np.column_stack([seen_px, points_mm])


def calibrated(
    folder: Path, capsys: pytest.CaptureFixture[str], mistake: Mistake, keys: str, of_points: str = ""
) -> Any:
    """What ``calibrate`` answers, and its exit status."""
    lines = ["[calibration]", keys]
    for name in AZIMUTHS_DEG:
        np.savetxt(folder / f"{name}.txt", mistake(table(name), name))
        lines += ["[[calibration.points]]", f'camera = "{name}"', f'file = "{name}.txt"', f"columns = {COLUMNS}"]
        lines += ["image_size_px = [320, 240]", of_points]
    (folder / "manifest.toml").write_text("\n".join(lines) + "\n")
    assert main(["import", str(folder / "manifest.toml"), "-o", str(folder / "set")]) == 0
    capsys.readouterr()
    status = main(["calibrate", str(folder / "set"), "-o", str(folder / "calibration.json"), "--json"])
    return json.loads(capsys.readouterr().out.splitlines()[-1]) | {"status": status}


def right(rows: FloatArray, _name: str) -> FloatArray:
    return rows


def of(views: tuple[str, ...], change: Callable[[FloatArray], FloatArray]) -> Mistake:
    return lambda rows, name: change(rows) if name in views else rows


ALL = tuple(AZIMUTHS_DEG)
MISTAKES: dict[str, tuple[Mistake, str]] = {
    "planes of one view reversed": (of(("cam2",), lambda rows: rows * (1, 1, 1, 1, -1)), "cam2: left-handed"),
    "stage counts the other way": (of(ALL, lambda rows: rows * (1, 1, 1, 1, -1)), "left-handed"),
    "one view by a mirror": (of(("cam2",), lambda rows: rows * (-1, 1, 1, 1, 1) + (319, 0, 0, 0, 0)), "mirrored = ["),
    "u and v exchanged": (of(ALL, lambda rows: rows[:, [1, 0, 2, 3, 4]]), "u and v, or x and y, exchanged"),
    "x and y exchanged": (of(ALL, lambda rows: rows[:, [0, 1, 3, 2, 4]]), "u and v, or x and y, exchanged"),
    "v from the bottom": (of(ALL, lambda rows: rows * (1, -1, 1, 1, 1) + (0, 239, 0, 0, 0)), 'v_axis = "up"'),
    "wrong pitch": (of(ALL, lambda rows: rows * (1, 1, 2.5 / 3, 2.5 / 3, 1)), "deg apart"),
    "metres": (of(ALL, lambda rows: rows * (1, 1, 1e-3, 1e-3, 1e-3)), "Say unit or scale_px_per_mm"),
    "inches": (of(ALL, lambda rows: rows * (1, 1, 1 / 25.4, 1 / 25.4, 1 / 25.4)), "Say unit or scale_px_per_mm"),
}
NEIGHBOURS = {"cam0": "cam1", "cam1": "cam0", "cam2": "cam2"}


def not_good(answer: dict[str, Any]) -> bool:
    """Whether no mistake has passed: refused, or some view is at best to be warned of."""
    verdicts = {view["verdict"] for view in answer.get("views", {}).values()}
    return "error" in answer or bool(verdicts & {"warn", "refuse"})


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_does_not_end_as_good(mistake: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    change, asks = MISTAKES[mistake]
    answer = calibrated(tmp_path, capsys, change, AZIMUTHS)
    assert not_good(answer), answer["views"]
    reasons = [reason for view in answer.get("views", {}).values() for reason in view["reasons"]]
    assert asks in answer.get("error", "; ".join(reasons))


def test_files_of_neighbours_exchanged_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    answer = calibrated(tmp_path, capsys, lambda _rows, name: table(NEIGHBOURS[name]), AZIMUTHS)
    assert not_good(answer), answer["views"]
    assert "have cam0 and cam1 been exchanged?" in answer["error"]


@pytest.mark.parametrize(("pair", "views"), [((0, 3), ALL), ((-3, 0), ("cam1",))], ids=["of all", "of one view"])
def test_two_planes_that_are_exchanged_are_named(
    pair: tuple[float, float], views: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """They were asked as a wrong pitch, or as cameras that are turned."""

    def exchange(rows: FloatArray) -> FloatArray:
        one, other = (rows[:, 4] == z_mm for z_mm in pair)
        rows[one, 4], rows[other, 4] = pair[::-1]
        return rows

    answer = calibrated(tmp_path, capsys, of(views, exchange), AZIMUTHS)
    assert not_good(answer)
    said = f"have the planes at z {pair[0]:g} and {pair[1]:g} mm been exchanged?"
    for name in views:
        reasons = "; ".join(answer.get("views", {}).get(name, {}).get("reasons", [answer.get("error")]))
        assert said in reasons
        assert "pitch" not in reasons


def test_columns_and_rows_that_are_exchanged_are_asked_for() -> None:
    lab = tomoshadow.example()
    board = tomoshadow.Checkerboard(columns=7, rows=11, pitch_mm=2.0)
    calibration = tomoshadow.calibrate(tomoshadow.find_target(lab.target, board, azimuth_deg=lab.azimuth_deg))
    for view in calibration.views.values():
        assert view.verdict == "warn"
        assert "have columns and rows of the target been exchanged (columns = 11, rows = 7)?" in view.reasons[0]


@pytest.mark.parametrize("still", [("cam1",), ALL], ids=["one view", "all"])
def test_a_target_that_never_moved_is_refused(
    still: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def stays(rows: FloatArray) -> FloatArray:
        rows[:, :2] = np.repeat(rows[1::3, :2], 3, axis=0)
        return rows

    answer = calibrated(tmp_path, capsys, of(still, stays), AZIMUTHS)
    assert not_good(answer), answer["views"]
    assert "does not depend on z" in answer["error"]


@pytest.mark.skipif("TOMOSHADOW_DATA" not in os.environ, reason="TOMOSHADOW_DATA is not set: no images from elsewhere")
@pytest.mark.parametrize(("key", "passes"), [("roll_deg = { cam2 = 180 }", False), ('mirrored = ["cam2"]', True)])
def test_a_board_by_a_mirror_is_not_good_by_the_wrong_word(
    key: str, passes: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A board looks the same by a mirror and upside down: only the particles of the run beside it tell."""
    given = Path(os.environ["TOMOSHADOW_DATA"], "faults", "02_planes_of_one_view_reversed")
    for path in given.glob("cam*.png"):
        image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        assert image is not None
        cv2.imwrite(str(tmp_path / path.name), image[:, ::-1] if path.name.startswith("cam2") else image)
    text = (given / "manifest.toml").read_text(encoding="utf-8").replace("[calibration]", f"[calibration]\n{key}", 1)
    exchanged = {"cam2_0.png": "cam2_2.png", "cam2_2.png": "cam2_0.png"}  # its planes in the right order
    text = re.sub("|".join(exchanged), lambda found: exchanged[found[0]], text)
    (tmp_path / "manifest.toml").write_text(text, encoding="utf-8")
    told(capsys, "import", tmp_path / "manifest.toml", "-o", tmp_path / "set")
    answer = told(capsys, "calibrate", tmp_path / "set", "-o", tmp_path / "calibration.json")
    assert not_good(answer) is not passes, answer["views"]
    assert passes or "agree within 4 px" in answer["views"]["cam2"]["reasons"][0]


def test_right_sets_stay_good_and_all_is_checked_that_is_stated(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    answer = calibrated(tmp_path, capsys, right, *STATED)
    assert {view["verdict"] for view in answer["views"].values()} == {"good"}
    assert (answer["status"], answer["notes"]) == (0, [])
    of_droplets, alike = (one["state"] for one in answer["not_checked"])
    assert "calibrate --run RUN" in of_droplets
    assert "nozzle and direction" in alike


def test_what_nothing_tells_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Pixels that count from 1 fit as well as others; so the answer says what to state."""
    answer = calibrated(tmp_path, capsys, lambda rows, _name: rows + (1, 1, 0, 0, 0), "")
    states = " ".join(one["state"] for one in answer.get("not_checked", []))
    assert all(key in states for key in ("azimuth_deg", "scale_px_per_mm", "pixel_origin", "--run RUN"))


@pytest.mark.parametrize(
    ("keys", "of_points", "written"),
    [
        (AZIMUTHS + 'mirrored = ["cam0", "cam1", "cam2"]\n', "", (-1, 1, 1, 1, 1, 319, 0)),
        (AZIMUTHS, 'v_axis = "up"\npixel_origin = 1', (1, -1, 1, 1, 1, 1, 240)),
        (AZIMUTHS + 'unit = "m"\n', "", (1, 1, 1e-3, 1e-3, 1e-3, 0, 0)),
    ],
    ids=["mirrored", "v up from 1", "metres"],
)
def test_what_is_stated_is_believed(
    keys: str, of_points: str, written: tuple[float, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scale, shift_px = np.array(written[:5]), np.array([*written[5:], 0, 0, 0])
    answer = calibrated(tmp_path, capsys, lambda rows, _name: rows * scale + shift_px, keys, of_points)
    for name, view in answer["views"].items():
        assert view["verdict"] == "good"
        assert view["placement"]["azimuth_deg"] == pytest.approx(AZIMUTHS_DEG[name], abs=0.2)


def test_tables_are_read_at_import_and_all_bad_ones_are_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = ["[calibration]"]
    for name, text in {"cam0": "u;v;x;y;z\n1;2;3;4;5\n", "cam1": "1,5;2,5;3,5;4,5;5,5\n", "cam2": ""}.items():
        (tmp_path / f"{name}.txt").write_text(text)
        lines += ["[[calibration.points]]", f'camera = "{name}"', f'file = "{name}.txt"', f"columns = {COLUMNS}"]
    (tmp_path / "manifest.toml").write_bytes(b"\xef\xbb\xbf" + "\n".join(lines).encode())
    assert main(["import", str(tmp_path / "manifest.toml"), "-o", str(tmp_path / "set")]) == 2
    complaint = capsys.readouterr().err
    assert "manifest.toml, line 4: " in complaint
    assert all(
        part in complaint for part in ("cam0.txt, line 1: ", "header line", "decimal commas", "cam2.txt: no points")
    )
    assert not (tmp_path / "set").exists()
