"""Old data opens for ever: files of every version that landed say today what they said on the day they were written."""

import hashlib
import json
import tomllib
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from daq.drivers.camera_profile import load_camera_profile
from daq.files.run_directory import RunReader, list_runs
from daq.files.verification import FlawKind, verify
from processing.reconstruction.settings import ReconstructionSettings
from processing.reconstruction.volume_file import read_volume
from processing.runs.manifest.importing import import_manifest
from processing.runs.results_file import volume_path
from processing.runs.shots.shot_result import ShotResult
from processing.runs.volumes.pipeline import reconstruct_shot
from server.lab.events import EventPublisher
from server.lab.jobs.job import Job, JobKind, JobState
from server.lab.jobs.job_recovery import jobs_on_disk
from server.lab.jobs.job_table import JobTable
from server.lab.watch import CalibrationWatch
from server.rig.config import load_config
from server.web.ui.draft import DraftStore, first_draft, plan_of
from tests.support.old_data import EXPECTED, copy_to_read, describe, describe_kind, frames_sha256, run

VERSIONS = sorted((Path(__file__).parents[1] / "fixtures").glob("v*"))


@pytest.fixture(params=VERSIONS, ids=lambda version: version.name)
def old(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """A copy of the files of one version."""
    return copy_to_read(request.param, tmp_path)


def expected_of(old: Path, kind: str) -> dict[str, Any]:
    """What the files of a kind said, by path."""
    expected: dict[str, Any] = json.loads((old / EXPECTED).read_text())[kind]
    return expected


def assert_holds(found: Any, expected: Any, where: str = "") -> None:
    """Everything that is expected is there; later versions may say more."""
    if isinstance(expected, dict):
        assert isinstance(found, dict), where
        assert expected.keys() <= found.keys(), where
        for key, value in expected.items():
            assert_holds(found[key], value, f"{where}/{key}")
    elif isinstance(expected, list):
        assert isinstance(found, list), where
        assert len(found) == len(expected), where
        for number, value in enumerate(expected):
            assert_holds(found[number], value, f"{where}/{number}")
    elif isinstance(expected, float):
        assert found == pytest.approx(expected, rel=1e-9, abs=1e-9), where
    else:
        assert found == expected, where


def assert_kind_holds(old: Path, kind: str) -> None:
    expected = expected_of(old, kind)
    assert expected
    assert_holds(describe_kind(old, kind), expected, kind)


def contents(folder: Path) -> dict[str, str]:
    """Hash of every file."""
    files = (path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


def test_runs_open_with_header_outcome_references_and_every_frame(old: Path) -> None:
    assert_kind_holds(old, "run")


def test_any_reader_of_hdf5_sees_a_whole_run_through_its_run_file(old: Path) -> None:
    for path, expected in expected_of(old, "run").items():
        with h5py.File(old / path / "run.h5", "r") as file:
            seen = frames_sha256(file)
        for view in expected["header"]["views"]:
            assert seen[view] == [shot["views"][view]["sha256"] for shot in expected["shots"]], path


def test_a_run_without_an_outcome_is_still_an_interrupted_one(old: Path) -> None:
    runs = expected_of(old, "run")
    interrupted = [Path(path).name for path, described in runs.items() if described["outcome"] is None]
    assert interrupted
    open_runs = [run_dir.name for run_dir in list_runs(old / "runs") if RunReader(run_dir).outcome is None]
    assert open_runs == interrupted


def test_whole_runs_are_verified_as_such(old: Path) -> None:
    for path, expected in expected_of(old, "run").items():
        flaws = {flaw.kind for flaw in verify(old / path).flaws}
        assert flaws == (set() if expected["outcome"] else {FlawKind.NO_OUTCOME}), path


def test_packed_runs_open(old: Path) -> None:
    assert_kind_holds(old, "packed run")


def test_truths_of_simulated_runs_open(old: Path) -> None:
    assert_kind_holds(old, "truth")


def test_calibrations_of_every_model_open_and_project_to_the_same_pixels(old: Path) -> None:
    assert_kind_holds(old, "calibration")


def test_targets_of_recorded_and_imported_sets_are_found(old: Path) -> None:
    assert_kind_holds(old, "calibration set")


def test_volumes_open(old: Path) -> None:
    assert_kind_holds(old, "volume")


def test_droplets_open_and_say_the_same_of_the_spray(old: Path) -> None:
    assert_kind_holds(old, "droplets")


def test_previews_open(old: Path) -> None:
    assert_kind_holds(old, "preview")


def test_the_server_lists_runs_results_and_calibrations(old: Path) -> None:
    assert_kind_holds(old, "data folder")


def test_opening_writes_nothing(old: Path) -> None:
    before = contents(old)
    describe(old)
    assert contents(old) == before


def test_jobs_of_every_kind_and_state_are_read(old: Path) -> None:
    assert_kind_holds(old, "job table")
    jobs = jobs_of(old).values()
    assert {"queued", "running", "done", "failed", "aborted"} <= {job.state for job in jobs}
    assert {"reconstruction", "calibration", "check"} <= {job.kind for job in jobs}


def jobs_of(old: Path) -> dict[str, Job]:
    """Jobs of the table by id."""
    table = JobTable(old / "runs" / "jobs.sqlite")
    jobs = {job.id: job for job in table.newest(limit=-1)}
    table.close()
    return jobs


def reconstructions(old: Path) -> list[Job]:
    """Those that are done, the oldest first."""
    done = [job for job in jobs_of(old).values() if (job.kind, job.state) == (JobKind.RECONSTRUCTION, JobState.DONE)]
    assert done
    return done[::-1]


def test_what_reconstructions_were_told_and_said_is_still_valid(old: Path) -> None:
    for job in jobs_of(old).values():
        if job.kind is JobKind.RECONSTRUCTION:
            assert_holds(ReconstructionSettings.model_validate(job.settings).model_dump(mode="json"), job.settings)
    for job in reconstructions(old):
        assert_holds(ShotResult.model_validate(job.result).model_dump(mode="json"), job.result)


def test_what_checks_said_still_judges_a_calibration(old: Path) -> None:
    checks = [job for job in jobs_of(old).values() if job.kind is JobKind.CHECK and job.state is JobState.DONE]
    judged = [job for job in checks if job.result and job.result["verdict"]]
    assert judged
    for job in judged:
        watch = CalibrationWatch(EventPublisher())
        watch.learn(job)
        assert job.result
        assert watch.standing
        assert_holds(watch.standing.model_dump(mode="json"), {key: job.result[key] for key in ("verdict", "views")})


def test_a_job_that_was_running_is_queued_again_and_can_be_done(old: Path) -> None:
    (running,) = [job for job in jobs_of(old).values() if job.state is JobState.RUNNING]
    table = JobTable(old / "runs" / "jobs.sqlite")
    assert table.requeue_interrupted() == 1
    assert table.move(running.id, JobState.RUNNING).settings == running.settings
    assert table.move(running.id, JobState.DONE, result={}).state is JobState.DONE
    table.close()


def test_a_lost_job_table_is_told_by_the_results(old: Path) -> None:
    restored = {job.id: job.settings for job in jobs_on_disk(old / "runs", EventPublisher())}
    assert restored == {job.id: job.settings for job in reconstructions(old)}


def test_shots_are_reconstructed_as_they_were(old: Path, tmp_path: Path) -> None:
    for job in reconstructions(old):
        run_dir, settings = old / "runs" / job.run_id, ReconstructionSettings.model_validate(job.settings)
        calibration_file = old / "runs" / "calibrations" / f"{job.calibration}.json"
        assert job.shot is not None
        assert job.results_id
        reconstruct_shot(run_dir, job.shot, calibration_file, settings, tmp_path / job.results_id)
        for frame in ("a", "b"):
            stored, grid, _ = read_volume(volume_path(run_dir / "results" / job.results_id, job.shot, frame))
            made, made_grid, _ = read_volume(volume_path(tmp_path / job.results_id, job.shot, frame))
            assert made_grid == grid
            if settings.method.iterative:  # of method version 1, whose scale depended on the angles of the views
                assert np.corrcoef(made.ravel(), stored.ravel())[0, 1] > 0.95
            else:  # whose images were resampled by another kernel
                assert np.abs(made - stored).max() < 0.06 * stored.max()


def test_a_manifest_imports_the_same_frames(old: Path, tmp_path: Path) -> None:
    import_manifest(old / "import" / "manifest.toml", tmp_path / "again")
    expected = expected_of(old, "run")["imported/run"]
    assert_holds(run(tmp_path / "again" / "run")["shots"], expected["shots"])


def test_the_configuration_of_the_rig_loads_and_is_that_of_its_runs(old: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(old)
    config = load_config(Path("rig.toml"))
    described = config.model_dump(mode="json")
    recorded = [run["header"]["configuration"] for path, run in expected_of(old, "run").items() if "runs/" in path]
    assert recorded
    for configuration in recorded:
        assert_holds(described, configuration)
    for profile in {view.camera.profile for view in config.views.values()}:
        written = tomllib.loads(profile.read_text())
        assert_holds(load_camera_profile(profile).model_dump(mode="json"), written)


def test_the_draft_of_a_plan_is_kept(old: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(old)
    path, config = old / "runs" / "draft.json", load_config(Path("rig.toml"))
    stored: dict[str, Any] = json.loads(path.read_text())
    assert stored.keys() <= first_draft(config).keys(), "the form has no place for these"
    values = DraftStore(path, config, EventPublisher()).values
    assert_holds(values, stored)
    plan = plan_of(values).model_dump(mode="json")
    pulse = {name: stored[name] for name in ("width_ns", "separation_ns", "current_a")}
    planned = {name: stored[name] for name in ("name", "kind", "shots", "rate_hz", "references", "calibration")}
    assert_holds(plan, {"pulse": pulse, **planned})
