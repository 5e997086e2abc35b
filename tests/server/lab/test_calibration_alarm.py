"""A view has moved since it was calibrated: the server says so, stops reconstructing, and goes on once it is mended."""

import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from fastapi import FastAPI

from processing.calibration.calibration_file import load_calibration, save_calibration
from processing.runs.run_check import self_calibrate_run
from server.lab.jobs.job import JobKind
from server.lab.services import Services
from server.lab.tasks import check_run
from server.web.app import create_api
from tests.server.web.test_api import use_a_calibration, wait_for_jobs
from tests.support.drifting_run import DRIFT_PX, write_droplet_run
from tests.support.drifting_views import calibration_of, views
from tests.support.memory_rig import SHAPE
from tests.support.serving import DEADLINE_S, Serving, plan_of, serving, write_spray

RUN = "drifted"


def checking(services: Services) -> FastAPI:
    """The application with the check that the product makes."""
    tasks = {JobKind.CHECK: check_run, JobKind.RECONSTRUCTION: write_spray}
    return create_api(replace(services, tasks=tasks))


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Serving]:
    """A server with a run whose view2 lies two pixels further right than in the calibration ``old``."""
    data_dir = tmp_path_factory.mktemp("alarm") / "runs"
    write_droplet_run(data_dir / RUN)
    (data_dir / "calibrations").mkdir()
    save_calibration(calibration_of(views()), data_dir / "calibrations" / "old.json")
    with serving(data_dir, build=checking) as server:
        yield server


def reconstructed_with(server: Serving, calibration: str, count: int) -> list[dict[str, Any]]:
    """Ask for all shots; their jobs once ``count`` jobs of the server have ended."""
    assert server.http.put("/api/calibrations/current", json={"id": calibration}).status_code == 200
    assert server.http.post("/api/jobs", json={"run_id": RUN}).status_code == 202
    return [job for job in wait_for_jobs(server, count) if job["calibration"] == calibration]


def test_a_moved_view_stops_reconstruction_until_the_droplets_have_put_it_right(server: Serving) -> None:
    stopped = reconstructed_with(server, "old", 2)
    assert [job["state"] for job in stopped] == ["failed", "failed"]
    assert "does not fit run drifted, shot 1" in stopped[0]["error"]
    assert "stop above 0.8 px" in stopped[0]["error"]
    standing = server.http.get("/api/rig").json()["calibration"]
    assert (standing["calibration"], standing["run_id"], standing["shot"]) == ("old", RUN, 1)
    assert (standing["verdict"], standing["shots_checked"] in (1, 2)) == ("refuse", True)
    assert standing["moved"] == "view2"
    assert standing["views"]["view2"] == pytest.approx(DRIFT_PX, abs=0.15)
    (alarm,) = [event for event in server.services.events.since(0) if event.name == "calibration_alarm"]
    assert (alarm.data["verdict"], alarm.data["view"]) == ("refuse", "view2")
    assert not list((server.services.data_dir / RUN).glob("results/*"))

    calibrations = server.services.data_dir / "calibrations"
    corrected = self_calibrate_run(server.services.data_dir / RUN, [0, 1], load_calibration(calibrations / "old.json"))
    save_calibration(corrected.calibration, calibrations / "new.json")
    done = reconstructed_with(server, "new", 4)
    assert [job["state"] for job in done] == ["done", "done"]
    assert [job["result"]["belonging"]["verdict"] for job in done] == ["good", "good"]
    standing = server.http.get("/api/rig").json()["calibration"]
    assert (standing["calibration"], standing["verdict"]) == ("new", "good")
    assert [path.name for path in sorted((server.services.data_dir / RUN / "shots").iterdir())] == ["0.h5", "1.h5"]


def test_another_calibration_ends_the_alarm(server: Serving) -> None:
    server.http.put("/api/calibrations/current", json={"id": "old"})
    reconstructed_with(server, "old", 2)
    (server.services.data_dir / "calibrations" / "unknown.json").write_text('{"id": "unknown"}')
    server.http.put("/api/calibrations/current", json={"id": "unknown"})
    assert server.http.get("/api/rig").json()["calibration"] is None


def test_recorded_shots_are_checked_one_at_a_time_and_the_last_one_always(tmp_path: Path) -> None:
    with serving(tmp_path / "runs") as server:
        use_a_calibration(server)
        server.run_to_its_end(plan_of(shots=4))
        wait_for_jobs(server, 4)
        deadline_s = time.monotonic() + DEADLINE_S
        while (newest := wait_for_jobs(server, 1, "check")[0])["shot"] != 3 or newest["state"] != "done":
            assert time.monotonic() < deadline_s
        assert newest["calibration"] == "cal"


def test_a_check_that_cannot_be_made_says_why_and_stops_nothing(tmp_path: Path) -> None:
    with serving(tmp_path / "runs", build=checking) as server:
        of_the_rig = [replace(camera, image_size_px=SHAPE[::-1]) for camera in views()]
        save_calibration(calibration_of(of_the_rig), server.services.data_dir / "calibrations" / "cal.json")
        server.http.put("/api/calibrations/current", json={"id": "cal"})
        server.run_to_its_end(plan_of(shots=1))
        assert [job["state"] for job in wait_for_jobs(server, 1)] == ["done"]
        (check,) = wait_for_jobs(server, 1, "check")
        assert check["state"] == "failed"
        assert "has views ['view1', 'view2'], calibration" in str(check["error"])
        assert server.http.get("/api/rig").json()["calibration"] is None
