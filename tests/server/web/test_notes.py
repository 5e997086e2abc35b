"""Notes of a run, changed by REST after it was recorded: told who, found by the search, refused where they must be."""

import json
from typing import Any

from daq.files.verification import verify
from tests.server.web.test_control import ANN, BOB
from tests.server.web.test_run_lists import listed
from tests.support.serving import Serving, plan_of

WATER, ETHANOL = {"fluid": "water"}, {"fluid": "ethanol", "pressure_bar": 6.0}
NOZZLE = {"nozzle_mm": [0.0, -8.4, 0.0], "axis": [0.0, 1.0, 0.0]}


def recorded(server: Serving) -> str:
    run_id, _ = server.run_to_its_end(plan_of(name="day", kind="dark", shots=1, notes=WATER))
    return run_id


def put(server: Serving, run_id: str, body: dict[str, Any], headers: dict[str, str] = ANN) -> Any:
    return server.http.put(f"/api/runs/{run_id}/notes", json=body, headers=headers)


def said(notes: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in notes.items() if value}


def test_notes_of_a_run_can_be_changed_are_found_and_it_is_told_who_did_it(server: Serving) -> None:
    run_id = recorded(server)
    run_file = server.services.data_dir / run_id / "run.h5"
    before = run_file.read_bytes()
    assert listed(server, text="water") == (["day"], 1)
    answer = put(server, run_id, {"notes": ETHANOL, "spray": NOZZLE}).json()
    assert (said(answer["notes"]), answer["notes_changed_by"]) == (ETHANOL, "ann@lab")
    assert (listed(server, text="ethanol"), listed(server, text="water")) == ((["day"], 1), ([], 0))
    history = server.http.get(f"/api/runs/{run_id}/notes").json()
    (change,) = history["changes"]
    assert (said(history["recorded"]), said(change["before"])) == (WATER, WATER)
    assert (history["recorded_spray"], change["spray"]) == (None, NOZZLE)
    assert change["at_utc"] == server.http.get(f"/api/runs/{run_id}").json()["notes_changed_utc"]
    assert run_file.read_bytes() == before
    assert said(server.http.get(f"/api/runs/{run_id}/header").json()["notes"]) == WATER
    deeds = [event.data for event in server.services.events.since(0) if event.name == "deed"]
    assert {"who": "ann@lab", "text": f"changed the notes of run {run_id}"} in deeds
    assert verify(run_file.parent).sound


def test_two_who_change_them_do_not_overwrite_each_other(server: Serving) -> None:
    run_id = recorded(server)
    assert put(server, run_id, {"notes": ETHANOL, "seen": 0}).status_code == 200
    refused = put(server, run_id, {"notes": {"fluid": "oil"}, "seen": 0})
    assert refused.status_code == 409
    assert "changed by ann@lab at" in refused.json()["detail"]
    assert put(server, run_id, {"notes": {"fluid": "oil"}, "seen": 1}).status_code == 200


def test_nor_do_two_who_change_nozzle_and_axis_alone(server: Serving) -> None:
    run_id = recorded(server)
    assert put(server, run_id, {"notes": WATER, "spray": NOZZLE, "seen": 0}).status_code == 200
    elsewhere = NOZZLE | {"nozzle_mm": [1.0, 0.0, 0.0]}
    refused = put(server, run_id, {"notes": WATER, "spray": elsewhere, "seen": 0})
    assert (refused.status_code, server.http.get(f"/api/runs/{run_id}/notes").json()["changes"][-1]["spray"]) == (
        409,
        NOZZLE,
    )
    assert put(server, run_id, {"notes": WATER, "spray": elsewhere, "seen": 1}).status_code == 200


def test_it_needs_control_and_limits_are_those_of_a_plan(server: Serving) -> None:
    run_id = recorded(server)
    server.http.put("/api/rig/control", headers=ANN)
    assert put(server, run_id, {"notes": ETHANOL}, BOB).status_code == 423
    for wrong in ({"remark": "x" * 4001}, {"fluid": "x" * 201}, {"fluid": "a\0"}, {"colour": "red"}):
        assert put(server, run_id, {"notes": wrong}).status_code == 422
    assert put(server, "none", {"notes": ETHANOL}).status_code == 404
    assert not (server.services.data_dir / run_id / "notes.json").exists()


def test_a_run_that_is_being_recorded_keeps_its_notes(server: Serving) -> None:
    run_id = server.http.post("/api/runs", json=plan_of(kind="dark", shots=1000), headers=ANN).json()["run_id"]
    answer = put(server, run_id, {"notes": ETHANOL})
    server.http.post("/api/rig/abort")
    server.wait()
    assert (answer.status_code, "is being recorded" in answer.json()["detail"]) == (409, True)
    assert put(server, run_id, {"notes": ETHANOL}).status_code == 200


def test_later_notes_that_are_damaged_are_told_and_hide_no_run(server: Serving) -> None:
    run_id = recorded(server)
    put(server, run_id, {"notes": ETHANOL})
    path = server.services.data_dir / run_id / "notes.json"
    path.write_text(json.dumps({"schema": "tomoshadow-notes"}))
    (run,) = server.http.get("/api/runs").json()
    assert (run["outcome"], said(run["notes"]), run["notes_changed_by"]) == ("completed", WATER, "")
    assert "notes.json: it cannot be read" in run["notes_flaw"]
    assert put(server, run_id, {"notes": ETHANOL}).status_code == 500
    assert server.http.get(f"/api/runs/{run_id}/notes").status_code == 500
