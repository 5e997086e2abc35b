"""``tomoshadow measure`` of double exposures: velocities in files and in JSON, or the reason why there are none."""

import json
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from processing.analysis.droplets.droplet_file import read_droplets
from processing.analysis.droplets.ghost_share import matches
from processing.studies.velocity.double_scenes import SEPARATION_NS
from tests.support.bright_scenes import BOX, GRID, moving_scene, write_bright_calibration, write_bright_run
from tests.support.command_line import told

VELOCITY_COLUMNS = {
    *("u_m_s", "v_m_s", "w_m_s", "partner", "p_pair", "p_runner_up"),
    *(f"cov_{pair}_m2_s2" for pair in ("uu", "uv", "uw", "vv", "vw", "ww")),
}


def measured(folder: Path, capsys: pytest.CaptureFixture[str], run: Path, *more: object) -> dict[str, Any]:
    calibration = write_bright_calibration(folder / "calibration.json")
    return told(capsys, "measure", run, "--calibration", calibration, "-o", folder / "out", f"--grid={BOX}", *more)


def test_velocities_are_those_of_the_droplets(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = moving_scene()
    run = write_bright_run(tmp_path / "run", frames=2, moving=scene)
    result = measured(tmp_path, capsys, run, "--export", "csv")
    velocity = result["shots"][0]["velocity"]
    _gamma, order, separation, *_ = (one["what"] for one in result["not_checked"])
    assert "whether A is the earlier exposure" in order
    assert f"whether exposure B comes {SEPARATION_NS} ns after A, as the run states" in separation
    assert (velocity["verdict"], velocity["separation_ns"]) == ("good", SEPARATION_NS)
    assert velocity["separation_source"] == "stated"
    assert velocity["share_paired"] > 0.97
    stored = read_droplets(tmp_path / "out" / result["shots"][0]["file"])
    columns = stored.columns
    assert set(columns) >= VELOCITY_COLUMNS
    points_mm = np.column_stack([columns[f"{axis}_mm"] for axis in "xyz"])
    first = columns["frame"] == "a"
    of_found, _ = matches(points_mm[first], scene.before.positions_mm, GRID.pitch_mm)
    paired = np.flatnonzero((columns["partner"][first] >= 0) & (of_found >= 0))
    true_m_s = scene.before.velocities_mm_per_s[of_found[paired]] / 1000
    found_m_s = np.column_stack([columns[f"{name}_m_s"] for name in "uvw"])[paired]
    voxel_m_s = GRID.pitch_mm / SEPARATION_NS * 1e6
    assert len(paired) == velocity["pairs"]
    assert np.sqrt(np.mean((found_m_s - true_m_s) ** 2)) < 0.06 * voxel_m_s
    partner = columns["partner"][paired]
    np.testing.assert_allclose(points_mm[partner] - points_mm[paired], found_m_s * 1e-6 * SEPARATION_NS, atol=1e-9)
    mean = result["velocity"]["mean_m_s"]
    for name, true in zip("uvw", true_m_s.mean(axis=0), strict=True):
        assert mean[name]["low"] < true < mean[name]["high"]
    assert result["velocity"]["intervals_over"] == "pairs"
    assert "u_m_s" in (tmp_path / "out" / "shot_00000_droplets.csv").read_text(encoding="utf-8").splitlines()[0]


def test_columns_have_units_and_the_file_says_where_velocities_come_from(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = write_bright_run(tmp_path / "run", frames=2, moving=moving_scene())
    result = measured(tmp_path, capsys, run)
    with h5py.File(tmp_path / "out" / result["shots"][0]["file"]) as file:
        units = {name: file["droplets"][name].attrs["units"] for name in VELOCITY_COLUMNS}
        said = json.loads(file["tomoshadow"].attrs["velocity"])
    assert {name for name, unit in units.items() if unit == "m/s"} == {"u_m_s", "v_m_s", "w_m_s"}
    assert {name for name, unit in units.items() if unit == "m^2/s^2"} == {
        name for name in VELOCITY_COLUMNS if name.startswith("cov")
    }
    assert said == result["shots"][0]["velocity"]


def test_a_separation_in_another_unit_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = write_bright_run(tmp_path / "run", frames=2, moving=moving_scene(), separation_ns=SEPARATION_NS // 1000)
    result = measured(tmp_path, capsys, run)
    (shot,) = result["shots"]
    assert shot["velocity"]["verdict"] == "doubtful"
    assert "faster than any spray: is the separation of" in shot["velocity"]["reasons"][0]
    (doubt,) = result["velocity"]["doubts"]
    assert doubt.startswith("velocities of 1 of 1 shot are doubtful, and count: droplets fly at")


def test_an_image_that_is_there_twice_gives_no_velocity(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    result = measured(tmp_path, capsys, write_bright_run(tmp_path / "run", frames=2))
    (shot,) = result["shots"]
    assert (shot["verdict"], shot["velocity"]) == ("good", None)
    for reason in (shot["velocity_reason"], result["velocity"]["reason"]):
        assert "view1, view2, view3, view4 has the very pixels of A: one image is there twice" in reason
    assert "u_m_s" not in read_droplets(tmp_path / "out" / shot["file"]).columns


@pytest.mark.parametrize(
    ("frames", "separation_ns", "reason"),
    [(1, None, "shots have one exposure"), (2, None, "nobody knows the time from exposure A to B")],
)
def test_without_a_second_exposure_or_a_separation_the_reason_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], frames: Any, separation_ns: int | None, reason: str
) -> None:
    run = write_bright_run(tmp_path / "run", frames=frames, separation_ns=separation_ns)
    result = measured(tmp_path, capsys, run)
    assert result["shots"][0]["velocity"] is None
    assert reason in result["shots"][0]["velocity_reason"]
    assert result["velocity"]["mean_m_s"] is None
    assert reason in result["velocity"]["reason"]
    assert not VELOCITY_COLUMNS & set(read_droplets(tmp_path / "out" / result["shots"][0]["file"]).columns)
