"""Runs by REST: their list with its filters, their small pictures, and their end."""

import cv2
import numpy as np

from tests.server.web.test_api import use_a_calibration, wait_for_jobs
from tests.support.serving import Serving, plan_of


def listed(server: Serving, **wanted: object) -> tuple[list[str], int]:
    """Names, and how many there are in all."""
    answer = server.http.get("/api/runs", params={name: str(value) for name, value in wanted.items()})
    assert answer.status_code == 200, answer.text
    return [run["name"] for run in answer.json()], int(answer.headers["x-total-count"])


def test_a_list_of_runs_can_be_filtered_and_turned_page_by_page(server: Serving) -> None:
    use_a_calibration(server)
    dark, _ = server.run_to_its_end(plan_of(name="night", kind="dark", shots=1))
    notes = {"fluid": "Water", "remark": "nozzle three is worn"}
    server.run_to_its_end(plan_of(name="day", shots=1, notes=notes, references=[dark]))
    wait_for_jobs(server, 1)
    assert listed(server) == (["day", "night"], 2)
    assert listed(server, kind="dark") == (["night"], 1)
    assert listed(server, text="water WORN") == (["day"], 1)
    assert listed(server, text=dark, kind="sample") == (["day"], 1)
    assert listed(server, results=True) == (["day"], 1)
    assert listed(server, outcome="failed") == ([], 0)
    assert listed(server, outcome="completed", limit=1, offset=1) == (["night"], 2)
    assert server.http.get("/api/runs", params={"outcome": "lost"}).status_code == 422
    assert server.http.get(f"/api/runs/{dark}").json()["references"] == []


def test_a_run_has_a_small_picture_of_its_first_shot_and_of_every_other(server: Serving) -> None:
    run_id, _ = server.run_to_its_end(plan_of(kind="dark", shots=2))
    answer = server.http.get(f"/api/runs/{run_id}/thumbnail.jpg")
    assert answer.headers["content-type"] == "image/jpeg"
    pixels = cv2.imdecode(np.frombuffer(answer.content, np.uint8), cv2.IMREAD_GRAYSCALE)
    assert pixels is not None
    assert pixels.shape[1] <= 128
    shot = server.http.get(f"/api/runs/{run_id}/thumbnail.jpg", params={"shot": 1})
    assert shot.headers["content-type"] == "image/jpeg"
    assert "shot 2" in server.http.get(f"/api/runs/{run_id}/thumbnail.jpg", params={"shot": 2}).json()["detail"]
    (server.services.data_dir / run_id / "shots" / "0.h5").unlink()
    assert server.http.get(f"/api/runs/{run_id}/thumbnail.jpg").status_code == 404


def test_a_run_is_deleted_by_whoever_writes_its_name(server: Serving) -> None:
    run_id, _ = server.run_to_its_end(plan_of(kind="dark", shots=1))
    address = f"/api/runs/{run_id}"
    assert server.http.delete(address).status_code == 422
    refused = server.http.delete(address, headers={"Tomoshadow-Name": "another"})
    assert (refused.status_code, refused.headers["content-type"]) == (422, "application/problem+json")
    answer = server.http.delete(address, headers={"Tomoshadow-Name": run_id})
    assert answer.json() == {"run_id": run_id, "was_reference_of": []}
    assert server.http.get(f"{address}/header").status_code == 404
    assert listed(server) == ([], 0)


def test_a_run_that_is_being_recorded_is_not_deleted(server: Serving) -> None:
    run_id = server.http.post("/api/runs", json=plan_of(kind="dark", shots=1000)).headers["location"].rsplit("/", 1)[-1]
    answer = server.http.delete(f"/api/runs/{run_id}", headers={"Tomoshadow-Name": run_id})
    assert answer.status_code == 409
    server.http.post("/api/rig/abort")
    server.wait()
    assert (server.services.data_dir / run_id).is_dir()


def test_no_two_downloads_have_one_name(server: Serving) -> None:
    use_a_calibration(server)
    run_id, _ = server.run_to_its_end(plan_of(shots=1))
    server.http.post("/api/jobs", json={"run_id": run_id, "settings": {"method": "minlos"}})
    wait_for_jobs(server, 2)
    names = set()
    for made in server.http.get(f"/api/runs/{run_id}/results").json():
        for volume in made["volumes"]:
            address = f"/api/runs/{run_id}/results/{made['id']}/{volume['name']}/volume.vtkhdf"
            names.add(server.http.get(address).headers["content-disposition"])
    assert len(names) == 4
    assert sum("minlos" in name for name in names) == 2
    assert all(run_id in name for name in names)
