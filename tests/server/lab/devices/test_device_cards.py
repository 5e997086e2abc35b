from pathlib import Path
from typing import Any

import pytest

from server.lab.devices.device_cards import DeviceCard, device_cards
from server.lab.duty import Duty
from tests.support.memory_rig import VIEWS
from tests.support.server_process import eventually
from tests.support.serving import Serving, plan_of

SLOW: dict[str, Any] = {"kind": "dark", "shots": 3, "rate_hz": 0.2}


def cards(server: Serving) -> dict[str, dict[str, Any]]:
    return {card["name"]: card for card in server.http.get("/api/rig/devices").json()}


def limits(card: dict[str, Any]) -> dict[str, str]:
    return {limit["what"]: limit["value"] for limit in card["limits"]}


def asked(server: Serving) -> dict[str, dict[str, Any]]:
    """The cards once every device has answered."""
    eventually(lambda: all(card["detail"] != "not asked yet" for card in cards(server).values()), "all are asked")
    return cards(server)


def test_every_device_has_a_card_that_says_who_it_is_and_what_it_may(server: Serving) -> None:
    found = asked(server)
    assert list(found) == [*VIEWS, "pulse generator", "interlock", "disk", "work in the background"]
    assert found["view1"]["identity"] == {
        "vendor": "tomoshadow",
        "model": "memory",
        "serial": "view1",
        "firmware": "1",
    }
    assert limits(found["view1"])["image"] == "128 x 96 px, 8 bit"
    assert limits(found["view1"])["rate"] == "at most 47.57 shots/s"
    generator = limits(found["pulse generator"])
    assert generator["LED view2"] == "at most 12 A, nominal 10 A, channel 1"
    assert generator["pulse width"] == "250 to 2000 ns"
    assert found["pulse generator"]["identity"]["model"] == "memory"
    assert found["interlock"]["detail"] == "closed"
    assert found["work in the background"]["detail"] == "all of it goes on"
    assert {card["remedy"] for card in found.values()} <= {
        "",
        "delete or move away what is not needed, or take fewer shots",
    }
    assert [name for name, card in found.items() if card["can_reconnect"]] == [*VIEWS, "pulse generator"]


def test_a_card_tells_the_last_error_and_what_to_do(server: Serving) -> None:
    asked(server)
    laboratory: Any = server.services.laboratory
    laboratory.cameras["view2"].is_lost = True
    laboratory.open_door()
    eventually(lambda: cards(server)["view2"]["health"] == "fault", "the camera is missed")
    eventually(lambda: cards(server)["interlock"]["health"] == "fault", "the door is seen")
    found = cards(server)
    assert found["view2"]["detail"] == "view2: does not answer"
    assert "check power and cable of the camera" in found["view2"]["remedy"]
    assert found["view2"]["identity"] is None, "whoever answers next may be another one"
    assert found["interlock"]["remedy"] == "close the door"


def test_work_that_fails_is_on_its_card(server: Serving) -> None:
    duty: Duty = server.app.state.context.duties[0]
    duty.fail("a job", ValueError("broken"))
    card = device_cards(server.app.state.context)[-1]
    assert isinstance(card, DeviceCard)
    assert (card.health, "processing: a job: ValueError: broken" in card.detail) == ("fault", True)
    assert "mend what the text names" in card.remedy


def test_a_device_is_opened_again_now_but_not_while_a_run_goes_on(server: Serving) -> None:
    asked(server)
    laboratory: Any = server.services.laboratory
    recovered: list[int] = []
    camera = laboratory.cameras["view1"]
    camera.recover = lambda: recovered.append(1)
    before = len(recovered)
    answer = server.http.post("/api/rig/devices/view1/reconnect")
    assert (answer.status_code, answer.json()["identity"]["serial"]) == (200, "view1")
    assert len(recovered) > before
    assert server.http.post("/api/rig/devices/nobody/reconnect").status_code == 404
    server.http.post("/api/runs", json=plan_of(**SLOW))
    refused = server.http.post("/api/rig/devices/view1/reconnect")
    assert (refused.status_code, "between runs only" in refused.json()["detail"]) == (409, True)
    assert not cards(server)["view1"]["can_reconnect"]
    server.http.post("/api/rig/abort")
    server.wait()


def test_the_doctor_looks_between_runs_only_and_names_every_device(server: Serving) -> None:
    server.http.post("/api/runs", json=plan_of(**SLOW))
    refused = server.http.post("/api/rig/doctor")
    assert (refused.status_code, "between runs only" in refused.json()["detail"]) == (409, True)
    server.http.post("/api/rig/abort")
    server.wait()
    asked(server)
    found = {finding["name"]: finding for finding in server.http.post("/api/rig/doctor").json()}
    assert {"host", "disk", "network of view1", "view1", "pulse generator", "interlock"} <= set(found)
    assert found["view1"]["detail"] == "tomoshadow memory, view1"
    assert found["interlock"]["status"] == "ok"


@pytest.mark.parametrize("path", ["/api/rig/devices", "/api/rig/network"])
def test_what_can_be_read_is_of_the_rig(server: Serving, path: str, tmp_path: Path) -> None:
    assert server.http.get(path).status_code == 200
