import json
import struct
import threading
from typing import Any

import cv2
import httpx
import numpy as np
import pytest
from numpy.typing import NDArray

from processing.reconstruction.settings import ReconstructionSettings
from server.pictures.previews import load_preview, preview_path, save_preview
from tests.support.serving import DEADLINE_S, Serving, plan_of


def decode(png: bytes) -> NDArray[Any]:
    pixels = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_UNCHANGED)
    assert pixels is not None
    return pixels


def wait_for_jobs(server: Serving, count: int, kind: str = "reconstruction") -> list[dict[str, Any]]:
    """Jobs of a kind, once that many have ended."""
    events = server.services.events
    changed = threading.Event()
    deadline = threading.Timer(DEADLINE_S, changed.set)
    deadline.start()
    while not changed.wait(0.02):
        jobs = server.http.get("/api/jobs", params={"kind": kind}).json()
        if sum(job["state"] in ("done", "failed", "aborted") for job in jobs) >= count:
            deadline.cancel()
            return list(jobs)
    raise AssertionError(f"jobs did not end: {server.http.get('/api/jobs').text}, {events.newest} events")


def use_a_calibration(server: Serving) -> None:
    path = server.services.data_dir / "calibrations" / "cal.json"
    path.write_text('{"id": "cal"}')
    assert server.http.put("/api/calibrations/current", json={"id": "cal"}).status_code == 200


def test_the_rig_shows_its_lamps_and_an_idle_acquisition(server: Serving) -> None:
    rig = server.http.get("/api/rig").json()
    assert rig["acquisition"]["state"] == "idle"
    assert {lamp["name"]: lamp["health"] for lamp in rig["lamps"]} == {
        "view1": "ok",
        "view2": "ok",
        "pulse generator": "ok",
        "interlock": "ok",
        "disk": rig["lamps"][-1]["health"],
    }


def test_a_run_is_started_located_recorded_and_listed(server: Serving) -> None:
    run_id, status = server.run_to_its_end(plan_of(shots=3))
    assert (status.shots_recorded, status.shots_valid) == (3, 3)
    run = server.http.get(f"/api/runs/{run_id}").json()
    assert (run["outcome"], run["shots_valid"], run["kind"]) == ("completed", 3, "sample")
    assert [item["run_id"] for item in server.http.get("/api/runs").json()] == [run_id]
    assert server.http.get(f"/api/runs/{run_id}/header").json()["plan"]["shots"] == 3


def test_shots_can_be_looked_at(server: Serving) -> None:
    run_id, _ = server.run_to_its_end(plan_of())
    shots = server.http.get(f"/api/runs/{run_id}/shots").json()
    assert shots == [{"index": 0, "image_key": "sample"}, {"index": 1, "image_key": "sample"}]
    detail = server.http.get(f"/api/runs/{run_id}/shots/1").json()
    assert detail["exposures"]["view1"]["a"]["valid"]
    first, second = detail["fired"]["pulses"]["view2"]
    assert second["start_ns"] - first["start_ns"] == 6400
    picture = server.http.get(f"/api/runs/{run_id}/shots/1/view1/b.png")
    pixels = decode(picture.content)
    assert pixels.shape == (96, 128)
    assert pixels[36, 40] < 10 < pixels[5, 5]
    small = server.http.get(f"/api/runs/{run_id}/shots/1/view1/b.png", params={"width_px": 32, "stretch": "full"})
    assert decode(small.content).shape == (24, 32)


@pytest.mark.parametrize(
    ("plan", "status", "text"),
    [
        (plan_of(shots=0), 422, "shots"),
        (plan_of(shot=1), 422, "Extra inputs"),
        (plan_of(rate_hz=90.0), 422, "limit of the cameras"),
        (plan_of(pulse={"current_a": {"view1": 5}}), 422, "the rig has"),
        (plan_of(pulse={"current_a": {"view1": 5, "view2": 5}, "separation_ns": 2500}), 422, "limit of camera view1"),
        (plan_of(calibration="nothing"), 422, "no calibration 'nothing'"),
    ],
)
def test_a_plan_is_refused_with_its_reason(server: Serving, plan: dict[str, object], status: int, text: str) -> None:
    answer = server.http.post("/api/runs", json=plan)
    assert (answer.status_code, answer.headers["content-type"]) == (status, "application/problem+json")
    assert text in answer.json()["detail"]


def test_a_busy_rig_an_open_door_and_an_idle_rig_answer_conflicts(server: Serving) -> None:
    answer = server.http.post("/api/runs", json=plan_of(shots=1000, rate_hz=5.0))
    run = answer.headers["location"]
    busy = server.http.post("/api/runs", json=plan_of())
    assert (busy.status_code, busy.json()["type"]) == (409, "urn:tomoshadow:BusyError")
    assert server.http.post(f"{run}/abort").status_code == 202
    assert server.wait().outcome == "aborted"
    assert server.http.post(f"{run}/abort").status_code == 409
    server.http.put("/api/bench/door", json={"open": True})
    locked = server.http.post("/api/runs", json=plan_of())
    assert (locked.status_code, locked.json()["title"]) == (423, "Locked")


def test_a_run_stops_at_the_shot_boundary(server: Serving) -> None:
    run = server.http.post("/api/runs", json=plan_of(shots=1000, rate_hz=20.0)).headers["location"]
    assert server.http.post(f"{run}/stop").status_code == 202
    status = server.wait()
    assert status.outcome == "stopped"
    assert status.shots_valid == status.shots_recorded < 1000


def test_recorded_shots_are_reconstructed_by_themselves(server: Serving) -> None:
    use_a_calibration(server)
    run_id, _ = server.run_to_its_end(plan_of())
    jobs = wait_for_jobs(server, 2)
    assert sorted((job["shot"], job["state"], job["calibration"]) for job in jobs) == [
        (0, "done", "cal"),
        (1, "done", "cal"),
    ]
    assert server.http.get(f"/api/runs/{run_id}").json()["calibration"] == "cal"
    assert len(server.http.get("/api/jobs", params={"run_id": run_id, "kind": "reconstruction"}).json()) == 2
    again = server.http.post("/api/jobs", json={"run_id": run_id})
    assert [job["state"] for job in again.json()] == ["done", "done"]
    chosen = {"method": "minlos", "accuracy": "fine", "voxels": "uint8"}
    server.http.post("/api/jobs", json={"run_id": run_id, "shots": [1], "settings": chosen})
    newest, *_ = wait_for_jobs(server, 3)
    assert newest["settings"] == ReconstructionSettings.model_validate(chosen).model_dump(mode="json")
    finest, *_ = server.http.get(f"/api/runs/{run_id}/results").json()
    assert json.loads(finest["provenance"]["settings"]) == newest["settings"]


def test_an_invalid_shot_is_recorded_and_not_reconstructed(server: Serving) -> None:
    use_a_calibration(server)
    server.http.post("/api/bench/faults", json={"kind": "dropped_b", "view": "view1"})
    run_id, status = server.run_to_its_end(plan_of(shots=2, refire_quota=0))
    assert (status.shots_recorded, status.shots_valid) == (2, 1)
    assert [job["shot"] for job in wait_for_jobs(server, 1)] == [1]
    assert server.http.get(f"/api/runs/{run_id}/shots").json()[0]["image_key"] == "invalid"


def test_dark_runs_are_not_reconstructed_and_cannot_be_without_calibration(server: Serving) -> None:
    run_id, _ = server.run_to_its_end(plan_of(kind="dark"))
    assert server.http.get("/api/jobs").json() == []
    refused = server.http.post("/api/jobs", json={"run_id": run_id})
    assert (refused.status_code, refused.json()["type"]) == (422, "urn:tomoshadow:Unprocessable")


def test_volumes_are_listed_sliced_projected_meshed_and_downloaded(server: Serving) -> None:
    use_a_calibration(server)
    run_id, _ = server.run_to_its_end(plan_of(shots=1))
    wait_for_jobs(server, 1)
    (result_set,) = server.http.get(f"/api/runs/{run_id}/results").json()
    assert [volume["name"] for volume in result_set["volumes"]] == ["shot_00000_a", "shot_00000_b"]
    volume = f"/api/runs/{run_id}/results/{result_set['id']}/shot_00000_a"
    preview = server.http.get(volume).json()
    assert (preview["shape"], preview["pitch_mm"]) == ([40, 60, 50], 0.2)
    for axis, shape in (("z", (60, 50)), ("y", (40, 50)), ("x", (60, 40))):
        for picture in (f"{volume}/slices/{axis}/20.png", f"{volume}/projections/{axis}.png"):
            assert decode(server.http.get(picture).content).shape == (*shape, 3)
    assert server.http.get(f"{volume}/slices/z/40.png").status_code == 404
    mesh = server.http.get(f"{volume}/surface.glb", params={"level": 0.4}).content
    for picture in (f"{volume}/slices/z/20.png", f"{volume}/surface.glb"):  # made again, it may look otherwise
        shown = server.http.get(picture)
        assert shown.headers["cache-control"] == "no-cache"
        assert server.http.get(picture, headers={"If-None-Match": shown.headers["etag"]}).status_code == 304
    assert struct.unpack("<4sII", mesh[:12]) == (b"glTF", 2, len(mesh))
    assert server.http.get(f"{volume}/volume.vtkhdf").content == b"volume"


def test_a_volume_of_which_only_a_preview_is_kept_is_made_when_it_is_asked_for(server: Serving) -> None:
    use_a_calibration(server)
    run_id, _ = server.run_to_its_end(plan_of(shots=1))
    (job,) = wait_for_jobs(server, 1)
    results_dir = server.services.data_dir / run_id / "results" / job["results_id"]
    made_by = json.loads((results_dir / "settings.json").read_text()) | {"shot": 0}
    for name in ("shot_00000_a", "shot_00000_b"):
        (results_dir / f"{name}.vtkhdf").unlink()
        kept = preview_path(results_dir / f"{name}.vtkhdf")
        save_preview(kept, load_preview(kept), made_by if name.endswith("a") else {})
    (result_set,) = server.http.get(f"/api/runs/{run_id}/results").json()
    assert [volume["size_bytes"] for volume in result_set["volumes"]] == [0, 0]
    volumes = f"/api/runs/{run_id}/results/{job['results_id']}"
    unknown = server.http.get(f"{volumes}/shot_00000_b/volume.vtkhdf")
    assert (unknown.status_code, unknown.json()["type"]) == (500, "urn:tomoshadow:Damaged")
    assert server.http.get(f"{volumes}/shot_00000_a/volume.vtkhdf").content == b"volume"
    assert server.http.get(f"{volumes}/shot_00001_a/volume.vtkhdf").status_code == 404


def test_a_calibration_is_made_from_a_run_and_chosen(server: Serving) -> None:
    run_id, _ = server.run_to_its_end(plan_of(kind="calibration"))
    job = server.http.post("/api/calibrations", json={"run_id": run_id})
    assert (job.status_code, job.headers["location"]) == (202, f"/api/jobs/{job.json()['id']}")
    wait_for_jobs(server, 1, "calibration")
    name = f"{run_id}-pinhole"
    assert server.http.get(f"/api/calibrations/{name}").json()["model"] == "pinhole"
    server.http.put("/api/calibrations/current", json={"id": name})
    assert server.http.get("/api/calibrations").json() == [{"id": name, "current": True}]


def test_a_sample_run_makes_no_calibration(server: Serving) -> None:
    run_id, _ = server.run_to_its_end(plan_of())
    answer = server.http.post("/api/calibrations", json={"run_id": run_id})
    assert answer.status_code == 422
    assert "calibration run is needed" in answer.json()["detail"]


@pytest.mark.parametrize(
    ("method", "path", "status"),
    [
        ("GET", "/api/nothing", 404),
        ("GET", "/api/runs/none", 404),
        ("GET", "/api/runs/..%2f..%2fetc", 404),
        ("GET", "/api/runs/none/shots", 404),
        ("GET", "/api/calibrations/none", 404),
        ("GET", "/api/jobs/none", 404),
        ("GET", "/api/runs?limits=3", 422),
        ("GET", "/api/runs?limit=0", 422),
        ("DELETE", "/api/runs", 405),
        ("POST", "/api/runs", 422),
        ("POST", "/api/jobs/none/abort", 404),
    ],
)
def test_mistakes_are_answered_by_problem_documents(server: Serving, method: str, path: str, status: int) -> None:
    answer = server.http.request(method, path)
    assert (answer.status_code, answer.headers["content-type"]) == (status, "application/problem+json")
    assert answer.json()["status"] == status


def test_405_names_the_methods_of_all_routes_of_the_path(server: Serving) -> None:
    assert server.http.delete("/api/runs").headers["allow"] == "GET, POST"


def test_a_broken_shot_is_named(server: Serving) -> None:
    run_id, _ = server.run_to_its_end(plan_of(shots=1))
    shot = server.services.data_dir / run_id / "shots" / "0.h5"
    shot.write_bytes(b"nonsense")
    answer: httpx.Response = server.http.get(f"/api/runs/{run_id}/shots/0")
    assert (answer.status_code, answer.json()["type"]) == (500, "urn:tomoshadow:ShotFileError")
    assert "0.h5" in answer.json()["detail"]
