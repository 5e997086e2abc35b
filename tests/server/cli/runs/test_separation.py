"""``tomoshadow separation``: a proposal within what a rig's cameras accept, or the reason why there is none."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from processing.analysis.droplets.droplet_file import write_columns
from processing.reconstruction.settings import GridSettings
from processing.studies.simulated_droplets import study_grid
from tests.support.command_line import refused, shown, told

RIG = Path(__file__).parents[4] / "configs" / "spray4view.toml"
V_M_S = 20.0


def write_shots(folder: Path, v_m_s: float = V_M_S) -> Path:
    """Three shots of 50 droplets as measure writes them."""
    folder.mkdir()
    for number in range(3):
        rng = np.random.default_rng(number)
        columns = {
            "frame": np.repeat([b"a", b"b"], 50),
            **{f"{axis}_mm": rng.uniform(-0.1, 0.1, 100) for axis in "xyz"},
            **{
                f"{name}_m_s": along + rng.normal(0, 0.5, 100) for name, along in zip("uvw", (0, v_m_s, 0), strict=True)
            },
        }
        velocity = {"pairs": 50, "stayed": 50} if np.isfinite(v_m_s) else {"reasons": ["no motion in common"]}
        grid = GridSettings.of(study_grid((20, 20, 20))).model_dump_json()
        told_of: dict[str, Any] = {"run": "trial", "shot": number, "grid": grid, "velocity": json.dumps(velocity)}
        write_columns(folder / f"shot_{number:05d}_droplets.h5", columns, told_of)
    return folder


def test_five_voxels_are_proposed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    results = write_shots(tmp_path / "droplets")
    result = told(capsys, "separation", results)
    assert result["separation_ns"] == pytest.approx(5 / 60 / V_M_S * 1e6, rel=0.02)
    assert (result["shots"], result["pairs"], result["window_ns"], result["passed"]) == (3, 150, None, True)
    text = shown(capsys, "separation", results, "--voxels", "8")
    assert "by 150 pairs of 3 shots: the median droplet moves by 8.0 voxels" in text


def test_cameras_of_a_rig_limit_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shortest_ns, longest_ns = told(capsys, "optics", "--config", RIG)["straddling_window_ns"]
    slow = told(capsys, "separation", write_shots(tmp_path / "slow", 1e-2), "--config", RIG, "--voxels", "20")
    fast = told(capsys, "separation", write_shots(tmp_path / "fast", 900.0), "--config", RIG)
    assert fast["separation_ns"] == shortest_ns
    assert slow["separation_ns"] <= longest_ns
    assert f"cameras accept {shortest_ns} to {longest_ns} ns" in fast["reason"]


def test_without_velocities_or_shots_the_reason_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    result = told(capsys, "separation", write_shots(tmp_path / "nothing", np.nan), status=1)
    assert result["separation_ns"] is None
    assert result["reason"].startswith("no motion in common; where droplets move by more than 25 voxels")
    (tmp_path / "empty").mkdir()
    (tmp_path / "run.h5").touch()
    assert "is a run, and its own results have no droplets" in refused(capsys, "separation", tmp_path)
    assert "is a run, and its own results" in refused(capsys, "tracks", tmp_path, "-o", tmp_path / "tracks.h5")
    assert "has no droplets of shots" in refused(capsys, "separation", tmp_path / "empty")
