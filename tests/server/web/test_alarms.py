"""What is wrong is told one by one, and acknowledged one by one."""

from typing import Any

import pytest

from daq.errors import DeviceTimeout
from tests.support.server_process import eventually
from tests.support.serving import Serving, plan_of


@pytest.fixture
def laboratory(server: Serving) -> Any:
    return server.services.laboratory


def alarms(server: Serving) -> dict[str, dict[str, Any]]:
    return {alarm["source"]: alarm for alarm in server.http.get("/api/rig/alarms").json()}


def await_alarms(server: Serving, *sources: str) -> dict[str, dict[str, Any]]:
    eventually(lambda: set(alarms(server)) == set(sources), f"{sources} are told", lambda: str(alarms(server)))
    return alarms(server)


def acknowledge(server: Serving, alarm: dict[str, Any]) -> int:
    return server.http.post(f"/api/rig/alarms/{alarm['id']}/acknowledge").status_code


def test_two_causes_are_two_alarms_and_one_is_acknowledged_without_the_other(server: Serving, laboratory: Any) -> None:
    assert alarms(server) == {}
    laboratory.cameras["view2"].is_lost = True
    laboratory.generator.trip("overcurrent")
    found = await_alarms(server, "view2", "pulse generator")
    assert all(alarm["remedy"] for alarm in found.values())
    assert found["pulse generator"]["latched"]
    assert acknowledge(server, found["view2"]) == 202
    assert [alarm["acknowledged"] for alarm in alarms(server).values()] == [True, False]
    assert acknowledge(server, found["pulse generator"]) == 202
    await_alarms(server, "view2")
    laboratory.cameras["view2"].is_lost = False
    await_alarms(server)
    laboratory.cameras["view2"].is_lost = True
    assert not await_alarms(server, "view2")["view2"]["acknowledged"], "the same thing has happened again"
    assert acknowledge(server, found["pulse generator"]) == 404


def test_a_run_that_failed_says_why_until_the_next_one(server: Serving, laboratory: Any) -> None:
    laboratory.generator.silent_at = 1
    run_id, status = server.run_to_its_end(plan_of(shots=3))
    assert status.outcome == "failed"
    alarm = await_alarms(server, f"run {run_id}")[f"run {run_id}"]
    assert "no answer" in alarm["text"]
    assert acknowledge(server, alarm) == 202
    assert alarms(server)[f"run {run_id}"]["acknowledged"]
    laboratory.generator.silent_at = None
    server.run_to_its_end(plan_of(shots=1))
    await_alarms(server)


def test_of_two_causes_of_a_run_the_one_that_is_named_is_acknowledged(server: Serving, laboratory: Any) -> None:
    run_id = server.http.post("/api/runs", json=plan_of(shots=1000, rate_hz=5.0)).json()["run_id"]
    eventually(lambda: server.http.get("/api/rig").json()["acquisition"]["shots_recorded"] > 0, "shots are recorded")
    laboratory.generator.restarted = True
    laboratory.open_door()
    server.wait()
    laboratory.close_door()

    def left() -> list[str]:
        return [cause["text"] for cause in server.http.get("/api/rig").json()["acquisition"]["to_acknowledge"]]

    both = left()
    assert len(both) == 2
    eventually(lambda: len(of_run(server, run_id)) == 2, "both causes are told")
    alarm = next(alarm for alarm in of_run(server, run_id) if alarm["text"] == both[1])
    assert acknowledge(server, alarm) == 202
    assert left() == both[:1]
    seen = {alarm["text"]: alarm["acknowledged"] for alarm in of_run(server, run_id)}
    assert seen == {both[0]: False, both[1]: True}
    assert acknowledge(server, next(alarm for alarm in of_run(server, run_id) if alarm["text"] == both[0])) == 202
    assert left() == []


def test_a_live_view_that_failed_is_told_as_itself_until_the_next_start(server: Serving, laboratory: Any) -> None:
    run_id, _ = server.run_to_its_end(plan_of(shots=1))
    laboratory.generator.silent_at = laboratory.generator.fired + 1
    assert server.http.put("/api/rig/live", json={"rate_hz": 10, "pulse": None}).status_code == 200
    server.wait()
    laboratory.generator.silent_at = None
    alarm = await_alarms(server, "live view")["live view"]
    assert "no answer" in alarm["text"]
    assert not of_run(server, run_id), "that run was completed"
    assert acknowledge(server, alarm) == 202
    assert alarms(server)["live view"]["acknowledged"]
    server.run_to_its_end(plan_of(shots=1))
    await_alarms(server)


@pytest.mark.parametrize("end", [("DELETE", "/api/rig/live"), ("POST", "/api/rig/abort")])
def test_a_fault_has_a_line_of_its_own_which_ends_it(
    server: Serving, laboratory: Any, monkeypatch: pytest.MonkeyPatch, end: tuple[str, str]
) -> None:
    assert server.http.put("/api/rig/live", json={"rate_hz": 10, "pulse": None}).status_code == 200

    def silent() -> None:
        raise DeviceTimeout("generator", "off", 0.5)

    monkeypatch.setattr(laboratory.generator, "off", silent)
    server.http.request(*end)
    assert server.wait().state == "fault"
    monkeypatch.undo()
    laboratory.generator.trip("overcurrent")
    found = await_alarms(server, "live view", "pulse generator")
    assert "light not confirmed off" in found["live view"]["text"]
    assert "look at the LEDs" in found["live view"]["remedy"]
    assert acknowledge(server, found["pulse generator"]) == 202
    assert server.services.acquisition.status().state == "fault", "the light is another matter"
    assert acknowledge(server, found["live view"]) == 202
    assert server.services.acquisition.status().state == "idle"


def of_run(server: Serving, run_id: str) -> list[dict[str, Any]]:
    return [alarm for alarm in server.http.get("/api/rig/alarms").json() if alarm["source"] == f"run {run_id}"]


def test_an_open_door_is_no_alarm_and_a_fault_that_lasts_is_not_acknowledged(server: Serving, laboratory: Any) -> None:
    laboratory.open_door()
    laboratory.generator.trip("interlock")
    alarm = await_alarms(server, "pulse generator")["pulse generator"]
    assert acknowledge(server, alarm) == 423
    assert not alarms(server)["pulse generator"]["acknowledged"]
