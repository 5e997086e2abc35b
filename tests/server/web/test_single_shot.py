"""Single shots by REST: runs of one shot that stay on request only."""

from pathlib import Path
from typing import Any

from daq.run_plan import PulsePair, RunKind, RunPlan
from server.lab.jobs.job import reconstruction_job
from server.lab.jobs.job_table import JobTable
from server.lab.runs.unkept_runs import UNKEPT_FILE, UnkeptRuns
from tests.server.web.test_api import use_a_calibration, wait_for_jobs
from tests.support.memory_rig import VIEWS
from tests.support.serving import Serving, plan_of

SHOT = {"pulse": {"current_a": dict.fromkeys(VIEWS, 5)}}


def shoot(server: Serving, **changes: Any) -> str:
    answer = server.http.post("/api/rig/shot", json=SHOT | changes)
    assert answer.status_code == 201, answer.text
    assert server.wait().outcome == "completed"
    return str(answer.headers["location"].rsplit("/", 1)[-1])


def unkept(server: Serving) -> list[str]:
    return list(server.http.get("/api/rig/shot").json()["run_ids"])


def test_a_single_shot_is_seen_at_once_and_reconstructed_on_request(server: Serving) -> None:
    use_a_calibration(server)
    run_id = shoot(server)
    picture = server.http.get(f"/api/runs/{run_id}/shots/0/view1/b.png")
    assert picture.headers["content-type"] == "image/png"
    server.run_to_its_end(plan_of(shots=1))
    jobs = wait_for_jobs(server, 1)
    assert run_id not in {job["run_id"] for job in jobs}
    server.http.post("/api/jobs", json={"run_id": run_id})
    jobs = wait_for_jobs(server, 2)
    assert run_id in {job["run_id"] for job in jobs}


def test_the_next_one_takes_its_place_unless_it_is_kept(server: Serving) -> None:
    use_a_calibration(server)
    first = shoot(server)
    server.http.post("/api/jobs", json={"run_id": first})
    wait_for_jobs(server, 1)
    wait_for_jobs(server, 1, "check")
    second = shoot(server)
    assert unkept(server) == [second]
    assert server.http.get(f"/api/runs/{first}").status_code == 404
    assert server.http.get("/api/jobs", params={"run_id": first}).json() == []
    assert server.http.post("/api/rig/shot/keep", json={"run_id": second}).json() == {"run_ids": []}
    third = shoot(server)
    assert unkept(server) == [third]
    assert [run["run_id"] for run in server.http.get("/api/runs").json()] == [third, second]
    assert server.http.post("/api/rig/shot/keep", json={"run_id": "gone"}).status_code == 404


def test_a_shot_that_is_refused_leaves_the_last_one_alone(server: Serving) -> None:
    first = shoot(server)
    too_close = {"pulse": SHOT["pulse"] | {"separation_ns": 2000}}
    assert server.http.post("/api/rig/shot", json=too_close).status_code == 422
    server.http.post("/api/runs", json=plan_of(shots=3, rate_hz=0.2))
    assert server.http.post("/api/rig/shot", json=SHOT).status_code == 409
    server.http.post("/api/rig/abort")
    server.wait()
    assert unkept(server) == [first]
    assert server.http.get(f"/api/runs/{first}").status_code == 200


def test_a_shot_is_not_kept_where_the_disk_takes_no_note_and_says_so(server: Serving, tmp_path: Path) -> None:
    run_id = shoot(server)
    (blocked,) = (path.with_name(f"{UNKEPT_FILE}.part") for path in tmp_path.rglob(UNKEPT_FILE))
    blocked.mkdir()
    answer = server.http.post("/api/rig/shot/keep", json={"run_id": run_id})
    assert (answer.status_code, answer.json().get("type")) == (507, "urn:tomoshadow:StorageError")
    assert "takes no data" in answer.json()["detail"]
    assert unkept(server) == [run_id]


def test_it_is_taken_out_of_a_live_view_too(server: Serving) -> None:
    server.http.put("/api/rig/live", json={"rate_hz": 10, **SHOT})
    assert server.http.get(f"/api/runs/{shoot(server)}").json()["shots_valid"] == 1


def test_what_is_not_a_single_shot_is_never_removed(server: Serving, tmp_path: Path) -> None:
    data_dir = server.services.data_dir
    spray, _ = server.run_to_its_end(plan_of(shots=2))
    (data_dir / "precious").mkdir()
    (data_dir / UNKEPT_FILE).write_text(f"{spray}\nprecious\n../precious\n")
    jobs = JobTable(tmp_path / "jobs.sqlite")
    runs = UnkeptRuns(data_dir, jobs)
    assert runs.ids == (spray, "precious")
    runs.add(lambda: "next")
    assert runs.ids == UnkeptRuns(data_dir, jobs).ids == ("next",)
    assert (data_dir / spray).is_dir()
    assert (data_dir / "precious").is_dir()
    jobs.close()


def test_a_shot_that_is_being_worked_on_stays_until_it_is_not(server: Serving, tmp_path: Path) -> None:
    data_dir, acquisition = server.services.data_dir, server.services.acquisition
    plan = RunPlan(
        name="single-shot", kind=RunKind.BACKGROUND, shots=1, pulse=PulsePair(current_a=dict.fromkeys(VIEWS, 5.0))
    )
    jobs = JobTable(tmp_path / "jobs.sqlite")
    runs = UnkeptRuns(data_dir, jobs)
    first = runs.add(lambda: acquisition.start(plan))
    server.wait()
    jobs.add(reconstruction_job(first, 0, "cal", "mlos-1", {}))
    second = runs.add(lambda: acquisition.start(plan))
    server.wait()
    assert set(runs.ids) == {first, second}
    jobs.forget(first)
    runs.add(lambda: "third")
    assert set(runs.ids) == {"third"}
    assert not (data_dir / first).exists()
    jobs.close()
