"""The wheel in an environment without Aravis: an analysis machine, or a worker of a cluster.

``make test-wheel`` installs it, and names the environment's folder of programs.
"""

import json
import os
import subprocess
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from processing.synthetic.paper_rig import paper_optics
from processing.synthetic.target import Checkerboard, render_target
from tests.support.droplet_run import DROPLETS_A_MM, MOTION_MM, cameras, shadowgraph

PROGRAMS = os.environ.get("TOMOSHADOW_PROGRAMS")
BOARD = Checkerboard(columns=7, rows=5, pitch_mm=0.8)
PLANES_MM = (-1.0, 0.0, 1.0)
GRID = "-1.5:1.5,-1.5:1.5,-1:1@0.1"

pytestmark = pytest.mark.skipif(not PROGRAMS, reason="no wheel is installed; make test-wheel does that")


def ran(folder: Path, program: str, *arguments: str) -> str:
    """What an installed program prints that ends well, away from the checkout."""
    command = [f"{PROGRAMS}/{program}", *arguments]
    result = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=200, check=False)
    assert result.returncode == 0, result.stderr
    return result.stdout


def told(folder: Path, *arguments: str) -> dict[str, Any]:
    result: dict[str, Any] = json.loads(ran(folder, "tomoshadow", *arguments, "--json").splitlines()[-1])
    return result


@pytest.fixture
def laboratory(tmp_path: Path) -> Path:
    """A folder with images of a target and of two droplets, and the manifest that names them."""
    for name, camera in cameras().items():
        for z_mm in PLANES_MM:
            board = 255 * render_target(camera, BOARD, z_mm, paper_optics()["view1"])
            cv2.imwrite(str(tmp_path / f"{name}_{z_mm:g}.png"), board.astype(np.uint8))
        for step, frame in enumerate("ab"):
            droplets = shadowgraph(camera, DROPLETS_A_MM + step * MOTION_MM)
            cv2.imwrite(str(tmp_path / f"{name}_{frame}.png"), droplets)
    (tmp_path / "manifest.toml").write_text("\n".join(manifest()))
    return tmp_path


def manifest() -> Iterable[str]:
    size = f"columns = {BOARD.columns}, rows = {BOARD.rows}, pitch_mm = {BOARD.pitch_mm}"
    yield f'[calibration]\ntarget = {{ kind = "checkerboard", {size} }}'
    for z_mm in PLANES_MM:
        yield f"[[calibration.plane]]\nz_mm = {z_mm}\nimages = {images(f'{z_mm:g}')}"
    yield f'[run]\npolarity = "shadow"\n[[run.shot]]\nframe_a = {images("a")}\nframe_b = {images("b")}'


def images(name: str) -> str:
    return "{ " + ", ".join(f'{view} = "{view}_{name}.png"' for view in cameras()) + " }"


def test_the_environment_has_no_aravis_and_the_doctor_says_so(tmp_path: Path) -> None:
    ran(tmp_path, "python", "-c", "import importlib.util, sys; sys.exit(importlib.util.find_spec('gi') is not None)")
    statuses = {check["name"]: check["status"] for check in told(tmp_path, "doctor")["checks"]}
    assert (statuses["python packages"], statuses["aravis"]) == ("ok", "warn")


def test_images_become_a_mean_volume(laboratory: Path) -> None:
    told(laboratory, "import", "manifest.toml", "-o", "set")
    views = told(laboratory, "calibrate", "set/calibration", "-o", "calibration.json")["views"]
    assert {view["verdict"] for view in views.values()} == {"good"}
    common = ("--calibration", "calibration.json", f"--grid={GRID}")
    volumes = told(laboratory, "reconstruct", "set/run", *common, "-o", "volumes")["volumes"]
    assert [volume["frame"] for volume in volumes] == ["a", "b"]
    told(laboratory, "average", "volumes", "-o", "mean.vtkhdf")
    assert (laboratory / "mean.vtkhdf").is_file()


def test_a_study_runs(tmp_path: Path) -> None:
    result = told(tmp_path, "study", "average", "--shots", "1", "--binning", "4", "-o", "study")
    assert [row["method"] for row in result["rows"]] == ["gavlos", "minlos", "mlos", "smart"]
    assert (tmp_path / result["figure"]).is_file()
