"""``tomoshadow measure`` of a thread that hangs at a nozzle: its length, and all objects in the shot's file."""

import json
from dataclasses import dataclass, replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from processing.analysis.droplets.droplet_file import read_droplets
from processing.geometry import PinholeCamera
from processing.preprocessing import Intensity
from processing.studies.simulated_droplets import study_cameras
from processing.studies.velocity.double_scenes import SEPARATION_NS
from processing.synthetic.paper_rig import paper_optics
from processing.synthetic.rendering import render_transmittance
from processing.synthetic.spray import Spray
from tests.support.bright_scenes import write_bright_calibration, write_bright_run
from tests.support.command_line import refused, shown, told
from tests.support.shadow_scenes import write_shadow_calibration, write_shadow_run

BOX = "-0.7:0.7,0.75:1.0,-0.7:0.7@0.0166"
NOZZLE, LENGTH_MM = "0,-0.8,0", 1.0


@dataclass(frozen=True, eq=False)
class Seen:
    """Liquid as the paper's views see it."""

    images: list[Intensity]
    cameras: list[PinholeCamera]


def _thread(first_mm: tuple[float, float, float], last_mm: tuple[float, float, float], width_mm: float) -> Spray:
    first, last = np.array(first_mm), np.array(last_mm)
    steps = np.linspace(0, 1, 1 + int(np.linalg.norm(last - first) / (0.3 * width_mm)))[:, None]
    return Spray.of_droplets(first + steps * (last - first), np.full(len(steps), width_mm))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of a thread of 1 mm at the nozzle, one of 0.5 mm that is free, and droplets below them."""
    made = tmp_path_factory.mktemp("liquid")
    scene = _scene(np.zeros(3), np.random.default_rng(1))
    write_shadow_run(made / "run", scene)
    write_shadow_calibration(made / "calibration.json", scene)
    return made


def _scene(moved_mm: np.ndarray, rng: np.random.Generator) -> Seen:
    """The free thread and the droplets have moved so far."""
    placing = np.random.default_rng(1)
    places_mm = np.column_stack([np.linspace(-0.5, 0.5, 12), np.tile([0.8, 0.95], 6), placing.uniform(-0.5, 0.5, 12)])
    droplets = Spray.of_droplets(places_mm + moved_mm, np.full(12, 0.06))
    held = _thread((0, -0.8, 0), (0, -0.83 + LENGTH_MM, 0), 0.06)
    free = _thread((-0.6, -0.6, -0.1), (-0.6, -0.1, 0.1), 0.06)
    spray = Spray.joined([held, replace(free, positions_mm=free.positions_mm + moved_mm), droplets])
    cameras = study_cameras((280, 160))
    images = [
        (render_transmittance(camera, spray, optics) + rng.normal(0, 0.01, (160, 280))).astype(np.float32)
        for camera, optics in zip(cameras, paper_optics().values(), strict=True)
    ]
    return Seen(images, cameras)


def _command(folder: Path, out: Path, *more: object) -> list[object]:
    return ["measure", folder / "run", "--calibration", folder / "calibration.json", "-o", out, f"--grid={BOX}", *more]


def test_the_length_at_a_stated_nozzle_and_all_objects_are_told(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    result = told(capsys, *_command(folder, tmp_path / "out", f"--nozzle={NOZZLE}"))
    assert result["break_up_mm"]["value"] == pytest.approx(LENGTH_MM, abs=0.05)
    assert result["break_up_mm"]["low"] < LENGTH_MM < result["break_up_mm"]["high"]
    assert (result["ligaments"], result["sheets"], result["break_up_reason"]) == (1, 0, None)
    file = tmp_path / "out" / result["shots"][0]["file"]
    objects = read_droplets(file).objects
    assert "u_m_s" not in objects
    assert sorted(objects["class"].tolist()) == ["core", "ligament"]
    (free,) = np.flatnonzero(objects["class"] == "ligament")
    assert float(objects["length_mm"][free]) == pytest.approx(0.6, abs=0.08)
    np.testing.assert_allclose([objects[f"{axis}_mm"][free] for axis in "xyz"], [-0.6, -0.35, 0], atol=0.05)
    with h5py.File(file) as stored:
        assert stored["objects/length_mm"].attrs["units"] == "mm"
        exposure = json.loads(stored["tomoshadow"].attrs["exposures"])["a"]["objects"]
    assert exposure["reach"]["thresholds"] == [0.2, 0.3, 0.4, 0.5]
    assert 0 <= exposure["blind_share"] <= exposure["unjudged_share"] < 0.05


def test_of_double_exposures_objects_have_velocities_or_a_reason(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    moved_mm, rng = np.array([0.05, 0.12, 0.02]), np.random.default_rng(2)
    write_shadow_run(tmp_path / "run", _scene(np.zeros(3), rng), later=_scene(moved_mm, rng))
    arguments = _command(folder, tmp_path / "out", f"--nozzle={NOZZLE}")
    arguments[1] = tmp_path / "run"
    result = told(capsys, *arguments)
    objects = read_droplets(tmp_path / "out" / result["shots"][0]["file"]).objects
    assert sorted(zip(objects["frame"].tolist(), objects["class"].tolist(), strict=True)) == [
        ("a", "core"), ("a", "ligament"), ("b", "core"), ("b", "ligament")
    ]  # fmt: skip
    free = objects["class"] == "ligament"
    found_m_s, sd_m_s = (np.column_stack([objects[f"{name}{end}_m_s"] for name in "uvw"]) for end in ("", "_sd"))
    true_m_s = moved_mm / SEPARATION_NS * 1e6
    np.testing.assert_allclose(found_m_s[free], [true_m_s, true_m_s], atol=0.1)
    assert np.all((sd_m_s[free] > 0) & (sd_m_s[free] < 0.2))
    assert np.isnan(found_m_s[~free]).all()
    assert set(objects["velocity_reason"][~free]) == {"it hangs together with the nozzle: its parts move by themselves"}
    assert set(objects["velocity_reason"][free]) == {""}


def test_without_a_nozzle_the_remedy_is_told(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = shown(capsys, *_command(folder, tmp_path / "out"))
    assert "ligaments, 0 sheets" in out
    assert "no break-up length: nobody stated where the nozzle is: add [spray] nozzle_mm, axis to the run" in out


def test_numbers_that_are_no_nozzle_are_refused(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        shown(capsys, *_command(folder, tmp_path / "out", "--nozzle=0,0"))
    assert "0,0: x, y, z of the orifice in mm" in capsys.readouterr().err


def test_bright_particles_have_no_nozzle_and_no_objects(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_bright_run(tmp_path / "run", shots=1)
    write_bright_calibration(tmp_path / "calibration.json")
    assert "a nozzle is for shadows" in refused(capsys, *_command(tmp_path, tmp_path / "out", "--nozzle=0,0,0"))


def test_droplets_close_to_each_other_are_no_ligament(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rng, cameras = np.random.default_rng(3), study_cameras((280, 160))
    pair_mm = np.array([[0.0, 0.6, -0.075], [0.01, 0.62, 0.075]])
    others_mm = np.column_stack([np.linspace(-0.5, 0.5, 12), np.tile([0.8, 0.95], 6), rng.uniform(-0.5, 0.5, 12)])
    spray = Spray.of_droplets(np.vstack([pair_mm, others_mm]), np.array([0.1] * 2 + [0.06] * 12))
    images = [
        (render_transmittance(camera, spray, optics) + rng.normal(0, 0.01, (160, 280))).astype(np.float32)
        for camera, optics in zip(cameras, paper_optics().values(), strict=True)
    ]
    write_shadow_run(tmp_path / "run", Seen(images, cameras))
    write_shadow_calibration(tmp_path / "calibration.json", Seen(images, cameras))
    grid = "--grid=-0.7:0.7,0.45:1.0,-0.7:0.7@0.0166"
    answer = told(
        capsys,
        *["measure", tmp_path / "run", "--calibration", tmp_path / "calibration.json", "-o", tmp_path / "out", grid],
    )
    assert (answer["shots"][0]["droplets"], answer["ligaments"]) == (14, 0)
