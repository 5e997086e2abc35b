"""What a worker loads to do the work of jobs, and what it leaves of a volume."""

import json
import os
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from daq.files.run_directory import RunReader
from processing.reconstruction.choices import VoxelType
from processing.reconstruction.settings import GridSettings, ReconstructionSettings
from processing.reconstruction.volume_file import read_volume, write_volume
from processing.runs.volumes.pipeline import reconstruct_shot
from processing.runs.workbench import References, read_references
from processing.volume import VoxelGrid
from server.lab.errors import Damaged
from server.lab.results import preview_of, remaking, surface_of, volume_summaries
from server.lab.tasks import check_run, reconstruct
from server.pictures.previews import load_provenance, preview_files, preview_path, save_preview
from tests.support.droplet_run import write_calibration, write_run
from tests.support.fresh_interpreter import modules_after, packages_of

GRID = VoxelGrid.centred((61, 81, 201), 0.05)
"""A preview of it is coarser than the volume."""


def job_of(tmp_path: Path, settings: ReconstructionSettings) -> dict[str, Any]:
    return {
        "run_dir": str(write_run(tmp_path / "run")),
        "shot": 0,
        "calibration_file": str(write_calibration(tmp_path / "calibration.json")),
        "results_dir": str(tmp_path / "run" / "results" / "one"),
        "settings": settings.model_dump(mode="json"),
        "belonging": {"verdict": None, "shots": []},
    }


@pytest.mark.parametrize("voxels", VoxelType)
def test_of_a_volume_a_preview_is_kept_from_which_all_of_it_can_be_made(tmp_path: Path, voxels: VoxelType) -> None:
    settings = ReconstructionSettings(grid=GridSettings.of(GRID), minimum_window_px=0, voxels=voxels)
    job = job_of(tmp_path, settings)
    results_dir, calibration = Path(job["results_dir"]), Path(job["calibration_file"])
    told = reconstruct(job, lambda: False)
    assert [volume["file"] for volume in told["volumes"]] == ["shot_00000_a.vtkhdf", "shot_00000_b.vtkhdf"]
    assert [(one.name, one.size_bytes) for one in volume_summaries(results_dir)] == [
        ("shot_00000_a", 0),
        ("shot_00000_b", 0),
    ]
    volume = results_dir / "shot_00000_b.vtkhdf"
    at_once = preview_of(volume)
    assert at_once.voxels.max() == 255
    assert at_once.grid.pitch_mm > GRID.pitch_mm

    again = {**remaking(volume), "calibration_file": str(calibration)}
    assert again["belonging"] == job["belonging"]
    reconstruct(again, lambda: False)
    reconstruct_shot(tmp_path / "run", 0, calibration, settings, tmp_path / "by_command")
    for name in ("shot_00000_a.vtkhdf", "shot_00000_b.vtkhdf"):
        made, expected = (read_volume(place / name) for place in (results_dir, tmp_path / "by_command"))
        np.testing.assert_array_equal(made[0], expected[0])
        assert {**expected[2], "belonging": json.dumps(job["belonging"])} == made[2]
    preview_path(volume).unlink()
    later = preview_of(volume)
    assert (later.grid, later.limit, later.full_shape) == (at_once.grid, at_once.limit, at_once.full_shape)
    np.testing.assert_array_equal(later.voxels, at_once.voxels)


def test_the_surface_is_that_of_the_volume_as_it_is_now(tmp_path: Path) -> None:
    volume = tmp_path / "shot_00000_a.vtkhdf"
    ball = np.zeros(GRID.shape, np.float32)
    ball[20:30, 20:30, 20:30] = 1
    write_volume(volume, ball, GRID)
    first = surface_of(volume, 0.5)
    assert surface_of(volume, 0.5) == first
    write_volume(volume, ball[::-1], GRID)
    assert surface_of(volume, 0.5) != first


def test_a_volume_that_was_copied_back_from_before_is_shown_as_it_is(tmp_path: Path) -> None:
    """Copies keep their time, which may be older than that of the preview."""
    volume, old = tmp_path / "shot_00000_a.vtkhdf", tmp_path / "old.vtkhdf"
    ball = np.zeros(GRID.shape, np.float32)
    ball[20:30, 20:30, 20:30] = 1
    write_volume(old, ball, GRID)
    os.utime(old, ns=(10**18, 10**18))
    write_volume(volume, 3 * ball, GRID)
    assert preview_of(volume).limit == 3
    old.replace(volume)
    assert preview_of(volume).limit == 1
    write_volume(old, 2 * ball, GRID)
    os.utime(old, ns=(10**18, 10**18))
    old.replace(volume)
    preview_path(volume).unlink()
    assert preview_of(volume).limit == 2


def test_a_preview_under_another_name_or_in_another_folder_is_not_shown(tmp_path: Path) -> None:
    settings = ReconstructionSettings(grid=GridSettings.of(GRID), minimum_window_px=0)
    reconstruct(job := job_of(tmp_path, settings), lambda: False)
    first, _ = preview_files(results_dir := Path(job["results_dir"]))
    for file in (results_dir / "shot_00007_a.vtkhdf", results_dir / "shot_00000_b.vtkhdf"):
        shutil.copy(first, preview_path(file))
        with pytest.raises(Damaged, match=rf"{file.name} cannot be shown: it was renamed, .* shot 0, exposure a"):
            preview_of(file)
    preview_of(results_dir / "shot_00000_a.vtkhdf")
    elsewhere = shutil.copytree(results_dir, tmp_path / "run" / "results" / "two")
    record = json.loads((elsewhere / "settings.json").read_text())
    (elsewhere / "settings.json").write_text(json.dumps({**record, "calibration": "another"}))
    with pytest.raises(Damaged, match=r"brought from elsewhere, and is of calibration .*another"):
        preview_of(elsewhere / "shot_00000_a.vtkhdf")


def test_a_preview_that_does_not_say_how_it_was_made_is_named(tmp_path: Path) -> None:
    volume = tmp_path / "shot_00000_a.vtkhdf"
    settings = ReconstructionSettings(grid=GridSettings.of(GRID), minimum_window_px=0)
    reconstruct(job := job_of(tmp_path, settings), lambda: False)
    first, _ = preview_files(Path(job["results_dir"]))
    assert load_provenance(first)["run"] == "run"
    save_preview(preview_path(volume), preview_of(Path(job["results_dir"]) / volume.name))
    with pytest.raises(Damaged, match="cannot be made again: its preview does not say how"):
        remaking(volume)


def test_a_worker_loads_neither_web_nor_commands() -> None:
    modules = modules_after("import server.lab.tasks")
    assert "processing.runs.volumes.pipeline" in modules
    assert not {module for module in modules if module.startswith(("server.cli", "server.web"))}
    assert not packages_of(modules) & {"fastapi", "starlette", "nicegui", "uvicorn"}


def test_jobs_of_a_run_read_its_references_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    read: list[str] = []

    def counted(run: RunReader) -> References:
        read.append(run.header.run_id)
        return read_references(run)

    monkeypatch.setattr("processing.runs.workbench.read_references", counted)
    job = job_of(tmp_path, ReconstructionSettings(grid=GridSettings.of(GRID), minimum_window_px=0))
    reconstruct(job, lambda: False)
    check_run(job, lambda: False)
    reconstruct(job, lambda: False)
    assert read == ["run"]
