"""Pre-flight: everything that is looked at before a run, with figures where it is good and the refusal where not."""

import json
import re
import shutil

import pytest

from daq.run.refusals import RefusalCode
from daq.run_plan import RunPlan
from server.lab.desk.visitor import Visitor
from server.lab.starting.preflight_list import CODES, Check, CheckResult, check_control, checks_of
from server.lab.starting.readiness import reasons_against
from server.web.ui.run.chosen_runs import known_references
from tests.server.web.test_api import use_a_calibration
from tests.support.memory_rig import MemoryRig
from tests.support.serving import Serving, plan_of

ANN = Visitor("a", "ann")


def looked_at(server: Serving, **changes: object) -> dict[str, Check]:
    plan = RunPlan.model_validate(plan_of(**changes))
    context = server.app.state.context
    found = checks_of(context, plan, reasons_against(context, plan))
    return {check.name: check for check in (check_control(context, ANN), *found)}


def test_every_refusal_has_its_place_in_the_list() -> None:
    placed = [code for codes in CODES.values() for code in codes]
    assert sorted(placed) == sorted(RefusalCode)


def test_where_nothing_is_wrong_the_figures_are_told(server: Serving) -> None:
    use_a_calibration(server)
    found = looked_at(server, shots=1200, rate_hz=20)
    assert found["Cameras"].text == "2 answer"
    assert found["Interlock"].text == "closed"
    assert found["Light"].text == "at most 5 A, of 26 A that view2 may have"
    assert re.fullmatch(r"\d+ MB of \d+ GB free; 60 s at 20 Hz", found["Disk"].text)
    assert "of the wires" in found["Network"].text
    assert found["Calibration"].text.startswith("cal, ")
    assert (found["References"].finding, found["References"].text) == (
        CheckResult.WARN,
        "no dark run, no background run",
    )
    assert {check.finding for check in found.values()} == {CheckResult.GOOD, CheckResult.WARN}


def test_what_a_calibration_says_against_itself_is_told(server: Serving) -> None:
    use_a_calibration(server)
    doubted = {"id": "cal", "views": {"view1": {"verdict": "warn", "reasons": ["is pitch_mm right?"]}}}
    (server.services.data_dir / "calibrations" / "cal.json").write_text(json.dumps(doubted))
    found = looked_at(server)["Calibration"]
    assert (found.finding, found.text) == (CheckResult.WARN, "cal: warn: view1: is pitch_mm right?")


def test_what_is_wrong_stands_in_its_place_with_a_remedy_and_all_of_it(server: Serving) -> None:
    laboratory = server.services.laboratory
    assert laboratory is not None
    laboratory.open_door()
    server.app.state.context.control.require(Visitor("b", "bob"))
    found = looked_at(server, rate_hz=99, references=["no-run"], calibration="none")
    for name, word in (
        ("Interlock", "the interlock is open"),
        ("Timing", "limit of the cameras"),
        ("References", "no-run"),
        ("Calibration", "there is no calibration 'none'"),
        ("Control", "bob holds control"),
    ):
        assert found[name].finding is CheckResult.REFUSED, name
        assert word in found[name].text
        assert found[name].remedy
    laboratory.close_door()


def test_what_only_has_to_be_waited_for_is_no_refusal_to_mend(server: Serving) -> None:
    server.http.post("/api/runs", json=plan_of(shots=50, rate_hz=0.5))
    found = looked_at(server)
    assert (found["Rig"].finding, found["Rig"].remedy) == (CheckResult.WAIT, "wait for its end, or stop it")
    server.http.post("/api/rig/abort")
    server.wait()
    assert looked_at(server)["Rig"].finding is CheckResult.GOOD


def test_a_live_view_is_told_and_speaks_against_nothing(server: Serving) -> None:
    server.http.put("/api/rig/live", json={"rate_hz": 10})
    found = looked_at(server)["Rig"]
    assert (found.finding, found.text) == (CheckResult.GOOD, "a live view goes on: a start ends it")
    server.http.delete("/api/rig/live")


def test_without_a_calibration_nothing_is_made(server: Serving) -> None:
    assert looked_at(server)["Recipe"].text == "nothing is made without a calibration"
    use_a_calibration(server)
    assert looked_at(server)["Recipe"].text.startswith("volumes by MLOS, accuracy nominal (recipe ")
    assert looked_at(server, recipes=[])["Recipe"].text == "nothing is made by itself"


def test_a_small_share_of_the_wires_is_none_of_nothing(server: Serving) -> None:
    assert looked_at(server, rate_hz=0.01)["Network"].text.startswith("less than 1 % of the wires")


@pytest.mark.parametrize("kind", ["dark", "background"])
def test_a_background_needs_neither_references_nor_a_calibration(server: Serving, kind: str) -> None:
    assert not {"References", "Calibration"} & set(looked_at(server, kind=kind))


def test_references_older_than_any_list_are_known_for_what_they_are(server: Serving) -> None:
    dark, newer, background = (
        server.run_to_its_end(plan_of(kind=kind, shots=1))[0] for kind in ("dark", "dark", "background")
    )
    spray, _ = server.run_to_its_end(plan_of(shots=1))
    for number in range(101):
        shutil.copytree(server.services.data_dir / spray, server.services.data_dir / f"20990201T{number:06}-spray")
    found = looked_at(server, references=[newer, background])["References"]
    assert (found.finding, found.text) == (CheckResult.GOOD, "dark, background fit this light")
    assert looked_at(server, references=[newer, background, dark])["References"].finding is CheckResult.GOOD
    found = looked_at(server, references=[dark, background])["References"]
    assert found.text == f"a newer dark exists: {newer}"
    found = looked_at(server, references=[newer])["References"]
    assert found.text == "no background run"
    offered = [run.run_id for run in known_references(server.app.state.context.runs, [spray, "gone"])]
    assert offered == [newer, dark, background, spray], "what is chosen stays known, whatever it is"


def test_a_camera_that_was_exchanged_since_its_references_is_named_with_the_remedy(server: Serving) -> None:
    dark, _ = server.run_to_its_end(plan_of(kind="dark", shots=1))
    laboratory = server.services.laboratory
    assert isinstance(laboratory, MemoryRig)
    laboratory.cameras["view2"].serial = "77"
    assert server.http.post("/api/rig/devices/view2/reconnect").status_code == 200
    found = looked_at(server, references=[dark])["References"]
    assert found.text == (
        f"references: view2: {dark} was recorded by tomoshadow memory view2, and this is tomoshadow memory 77"
    )
    assert (found.finding, found.remedy) == (
        CheckResult.REFUSED,
        "put the camera back, or record dark and background again, and calibrate again",
    )


def test_references_say_what_differs_and_what_is_newer(server: Serving) -> None:
    old, _ = server.run_to_its_end(plan_of(kind="background", shots=1))
    new, _ = server.run_to_its_end(plan_of(kind="background", shots=1))
    found = looked_at(server, references=[old])["References"]
    assert found.finding is CheckResult.WARN
    assert f"a newer background exists: {new}" in found.text
    brighter = {"current_a": {"view1": 6, "view2": 5}}
    refused = looked_at(server, references=[new], pulse=brighter)["References"]
    assert "current of view1 5.0 A instead of 6.0 A" in refused.text
