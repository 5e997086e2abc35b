"""Images of others through the whole chain of commands: import, calibrate, reconstruct."""

import io
import json
import os
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.ndimage import maximum_filter
from scipy.spatial import cKDTree

from processing.analysis.velocity.moving_droplets import MovingDroplets
from processing.analysis.velocity.pairing import pair
from processing.geometry import FloatArray
from processing.reconstruction.settings import GridSettings
from processing.reconstruction.volume_file import read_volume
from server.cli.main import main
from tomoshadow import read_droplets

ROOT = Path(__file__).parents[2]
DATA = os.environ.get("TOMOSHADOW_DATA")

pytestmark = pytest.mark.skipif(not DATA, reason="TOMOSHADOW_DATA is not set: no images from elsewhere")


FLUIDIMAGE = "fluidimage_tomo_4cam_synth"


def told(*arguments: object) -> dict[str, Any]:
    with redirect_stdout(io.StringIO()) as printed:
        assert main([*map(str, arguments), "--json"]) == 0
    result: dict[str, Any] = json.loads(printed.getvalue().splitlines()[-1])
    return result


def imported_and_calibrated(name: str, out: Path) -> dict[str, Any]:
    told("import", ROOT / "tests" / "manifests" / f"{name}.toml", "-o", out / "set")
    views: dict[str, Any] = told("calibrate", out / "set" / "calibration", "-o", out / "calibration.json")["views"]
    return views


@pytest.fixture(scope="module")
def fluidimage(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """Four cameras: the folder of the set and its calibration, and the views of the latter."""
    out = tmp_path_factory.mktemp("fluidimage")
    return out, imported_and_calibrated(FLUIDIMAGE, out)


def test_particles_of_another_laboratory_are_found(fluidimage: tuple[Path, dict[str, Any]], tmp_path: Path) -> None:
    """MLOS has a maximum within a voxel of the triangulated particles."""
    given, views = fluidimage
    assert len(views) == 4
    assert all(view["mean_error_px"] <= 0.03 and view["verdict"] == "good" for view in views.values())
    told("reconstruct", given / "set" / "run", "--calibration", given / "calibration.json", "-o", tmp_path / "volumes")
    for frame in "ab":
        volume, grid, _ = read_volume(tmp_path / "volumes" / f"shot_00000_{frame}.vtkhdf")
        maxima = np.argwhere((volume == maximum_filter(volume, 3)) & (volume > 0))
        distance_voxel, _ = cKDTree(maxima).query(grid.to_index(listed_mm(frame)))
        assert np.mean(distance_voxel <= 1.0) >= 0.95


@pytest.fixture(scope="module")
def measured(fluidimage: tuple[Path, dict[str, Any]], tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Droplets of both exposures: what was told of the shot, and its columns."""
    given, _ = fluidimage
    out = tmp_path_factory.mktemp("droplets")
    arguments = ["--calibration", given / "calibration.json", "--polarity", "bright", "-o", out / "droplets"]
    (shot,) = told("measure", given / "set", *arguments)["shots"]
    return {**shot, "stored": read_droplets(out / "droplets" / shot["file"])}


def listed_mm(frame: str) -> FloatArray:
    """Particles as matching of single spots gives them."""
    file = Path(str(DATA), FLUIDIMAGE, f"triangulated_frame_{frame}_xyz_mm.csv")
    return np.asarray(np.loadtxt(file, delimiter=",", skiprows=1)[:, :3], np.float64)


def test_droplets_of_another_laboratory_are_measured(measured: dict[str, Any]) -> None:
    """Nearly all particles that matching of single spots gives, to a hundredth of a voxel, and more."""
    assert (measured["verdict"], measured["droplets"]) == ("good", pytest.approx(3199, abs=20))
    columns = measured["stored"].columns
    points_mm = np.column_stack([columns[axis] for axis in ("x_mm", "y_mm", "z_mm")])
    for frame in ("a", "b"):
        distance_mm, _ = cKDTree(points_mm[columns["frame"] == frame]).query(listed_mm(frame))
        assert np.mean(distance_mm < 0.05) >= 0.99
        assert np.median(distance_mm) < 0.002


def test_droplets_of_another_laboratory_are_paired(measured: dict[str, Any]) -> None:
    """Displacements of at most 0.8 mm, as of the single spots; one of twelve scatters by several voxels."""
    stored = measured["stored"]
    grid = GridSettings.model_validate_json(stored.provenance["grid"]).to_grid()
    moving, points_mm = [], []
    for frame in "ab":
        own = stored.columns["frame"] == frame
        column = {
            name: np.asarray(values[own], np.float64) for name, values in stored.columns.items() if name != "frame"
        }
        points_mm.append(np.column_stack([column[f"{axis}_mm"] for axis in "xyz"]))
        covariance = np.array([[column[f"cov_{min(a, b)}{max(a, b)}_mm2"] for a in "xyz"] for b in "xyz"])
        moving.append(
            MovingDroplets(
                grid.to_index(points_mm[-1])[:, ::-1],
                np.moveaxis(covariance, -1, 0) / grid.pitch_mm**2,
                np.log(column["amplitude"]),
            )
        )
    partners = pair(*moving).first
    paired = np.flatnonzero(partners.partner >= 0)
    moved_mm = points_mm[1][partners.partner[paired]] - points_mm[0][paired]
    assert len(paired) >= 0.91 * len(points_mm[0])
    assert np.linalg.norm(moved_mm, axis=1).max() < 0.8
    first_mm, second_mm = listed_mm("a"), listed_mm("b")
    near_mm, listed = cKDTree(first_mm).query(points_mm[0][paired])
    back_mm, there = cKDTree(second_mm).query(first_mm[listed] + moved_mm)
    both = (near_mm < 0.02) & (back_mm < 0.02)
    assert np.count_nonzero(both) >= 0.75 * len(first_mm)
    off_mm = second_mm[np.asarray(there)[both]] - first_mm[np.asarray(listed)[both]] - moved_mm[both]
    assert np.median(np.abs(off_mm)) < 0.002


def test_measured_points_of_another_laboratory(tmp_path: Path) -> None:
    """MyPTV, three cameras: points without images calibrate, and real particle images reconstruct."""
    views = imported_and_calibrated("myptv_3cam_dotplate", tmp_path)
    for name, expected_px in (("cam1", 0.219), ("cam2", 0.490), ("cam3", 0.518)):
        assert views[name]["rms_px"] == pytest.approx(expected_px, rel=0.2)
    arguments = ["--calibration", tmp_path / "calibration.json", "-o", tmp_path / "volumes", "--shots", "0:1"]
    result = told("reconstruct", tmp_path / "set" / "run", *arguments, "--grid=-10:10,-7:7,-10:-2@0.2")
    volume, _, _ = read_volume(tmp_path / "volumes" / result["volumes"][0]["file"])
    assert volume.max() > 0


def test_boards_in_free_poses_are_no_world(tmp_path: Path) -> None:
    """OpenCV's chessboards give lenses, not where the cameras stand."""
    views = imported_and_calibrated("opencv_chessboard_stereo", tmp_path)
    assert [len(view["planes"]) for view in views.values()] == [13, 13]
    assert all(view["rms_px"] < 0.50 for view in views.values())
