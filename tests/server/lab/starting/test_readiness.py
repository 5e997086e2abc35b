"""The rig is never ready where a start would be refused: every reason there is, on the rig and in the plan."""

import asyncio
import itertools
import json
import shutil
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import current_thread
from typing import Any

import pytest

from daq.devices import Rig
from daq.errors import DeviceError, DeviceTimeout
from daq.network import Network
from daq.run.refusals import REMEDIES, RefusalCode
from server.lab.desk.reason import UNSEEN
from server.lab.desk.rig_state import RigWord
from server.lab.desk.visitor import Role, Visitor
from server.web.ui.draft import DraftStore
from server.web.ui.draft import plan_of as draft_plan
from server.web.ui.form_judge import FormJudge
from tests.server.web.test_api import use_a_calibration
from tests.support.memory_rig import MemoryRig
from tests.support.server_process import eventually
from tests.support.serving import Serving, plan_of

FORM: dict[str, Any] = {"current_a": {"view1": 5, "view2": 5}, "volumes": "none"}
ANN = Visitor("a", "ann")
Situation = Callable[[Serving, pytest.MonkeyPatch], Any]


def laboratory(server: Serving) -> MemoryRig:
    assert isinstance(server.services.laboratory, MemoryRig)
    return server.services.laboratory


def acquisition(server: Serving) -> Any:
    return server.services.acquisition


@contextmanager
def starting(server: Serving, patch: pytest.MonkeyPatch) -> Iterator[None]:
    with acquisition(server)._starting:
        yield


@contextmanager
def busy(server: Serving, patch: pytest.MonkeyPatch) -> Iterator[None]:
    assert server.http.post("/api/runs", json=plan_of(shots=1000, rate_hz=5.0)).status_code == 201
    eventually(lambda: acquisition(server).status().shots_recorded > 0, "it is armed, which the text would tell")
    yield
    server.http.post("/api/rig/abort")
    server.wait()


@contextmanager
def light_not_off(server: Serving, patch: pytest.MonkeyPatch) -> Iterator[None]:
    laboratory(server).generator.stuck = True
    acquisition(server)._limits = replace(acquisition(server)._limits, light_off_s=0.1)
    server.http.post("/api/runs", json=plan_of(shots=1000, rate_hz=5.0))
    eventually(lambda: acquisition(server).status().shots_recorded > 0, "the generator is armed")
    server.http.post("/api/rig/abort")
    assert server.wait().state == "fault"
    yield
    laboratory(server).generator.stuck = False


@contextmanager
def ending(server: Serving, patch: pytest.MonkeyPatch) -> Iterator[None]:
    acquisition(server).leave("the server is being ended")
    yield


@contextmanager
def not_acknowledged(server: Serving, patch: pytest.MonkeyPatch) -> Iterator[None]:
    server.http.post("/api/runs", json=plan_of(shots=1000, rate_hz=5.0))
    eventually(lambda: acquisition(server).status().shots_recorded > 0, "shots are recorded")
    laboratory(server).generator.restarted = True
    laboratory(server).open_door()
    server.wait()
    laboratory(server).close_door()
    assert len(acquisition(server).status().to_acknowledge) == 2
    yield


@contextmanager
def folder_gone(server: Serving, patch: pytest.MonkeyPatch) -> Iterator[None]:
    """Another one has taken its place, on the same disk."""
    folder = server.services.data_dir
    aside = folder.rename(folder.with_name("before"))
    (folder / "calibrations").mkdir(parents=True)
    yield
    shutil.rmtree(folder)
    aside.rename(folder)


@contextmanager
def no_folder(server: Serving, patch: pytest.MonkeyPatch) -> Iterator[None]:
    folder = server.services.data_dir
    aside = folder.rename(folder.with_name("aside"))
    folder.touch()
    yield
    folder.unlink()
    aside.rename(folder)


@contextmanager
def disk_full(server: Serving, patch: pytest.MonkeyPatch) -> Iterator[None]:
    usage = shutil.disk_usage(server.services.data_dir)._replace(free=2**20)
    patch.setattr("daq.run.preflight.shutil.disk_usage", lambda _: usage)
    yield


@contextmanager
def door_open(server: Serving, patch: pytest.MonkeyPatch) -> Iterator[None]:
    laboratory(server).open_door()
    yield
    laboratory(server).close_door()


def raising(error: Exception) -> Callable[[], Any]:
    def ask() -> Any:
        raise error

    return ask


@contextmanager
def interlock_silent(server: Serving, patch: pytest.MonkeyPatch) -> Iterator[None]:
    error = DeviceError("door", "no such line")
    patch.setattr(laboratory(server).interlock, "is_closed", raising(error))
    yield


@contextmanager
def estop(server: Serving, patch: pytest.MonkeyPatch) -> Iterator[None]:
    generator = laboratory(server).generator
    said = replace(generator.status(), estop_closed=False)
    patch.setattr(generator, "status", lambda: said)
    yield


@contextmanager
def generator_fault(server: Serving, patch: pytest.MonkeyPatch) -> Iterator[None]:
    laboratory(server).generator.trip("overcurrent")
    yield


@contextmanager
def generator_silent(server: Serving, patch: pytest.MonkeyPatch) -> Iterator[None]:
    patch.setattr(laboratory(server).generator, "status", raising(DeviceTimeout("generator", "STATUS", 1.0)))
    yield


@contextmanager
def camera_silent(server: Serving, patch: pytest.MonkeyPatch) -> Iterator[None]:
    laboratory(server).cameras["view2"].is_lost = True

    def health() -> list[str]:
        return [lamp["health"] for lamp in server.http.get("/api/rig").json()["lamps"] if lamp["name"] == "view2"]

    eventually(lambda: health() == ["fault"], "its lamp is red")
    yield


@contextmanager
def thin_wire(server: Serving, patch: pytest.MonkeyPatch) -> Iterator[None]:
    rig: Rig = server.services.rig
    object.__setattr__(rig, "network", Network(camera_gbit_s=1e-4))
    yield


@contextmanager
def torn(server: Serving, patch: pytest.MonkeyPatch) -> Iterator[None]:
    (server.services.data_dir / "calibrations" / "torn.json").write_text('{"id": "torn", "views": {"vie')
    yield


@contextmanager
def other_size(server: Serving, patch: pytest.MonkeyPatch) -> Iterator[None]:
    views = {view: {"mapping": {"image_size_px": [64, 48]}} for view in ("view1", "view2")}
    (server.services.data_dir / "calibrations" / "small.json").write_text(json.dumps({"id": "small", "views": views}))
    yield


@contextmanager
def other_camera(server: Serving, patch: pytest.MonkeyPatch) -> Iterator[None]:
    """A dark run, and then another camera at the place of view2, which has told who it is."""
    run_id, _ = server.run_to_its_end(plan_of(kind="dark", shots=1))
    shutil.copytree(server.services.data_dir / run_id, server.services.data_dir / "of-another-camera")
    camera = laboratory(server).cameras["view2"]
    patch.setattr(camera, "serial", "77")
    assert server.http.post("/api/rig/devices/view2/reconnect").status_code == 200
    yield


@contextmanager
def calibrated(server: Serving, patch: pytest.MonkeyPatch) -> Iterator[None]:
    use_a_calibration(server)
    yield


OF_THE_RIG: dict[RefusalCode, Situation] = {
    RefusalCode.STARTING: starting,
    RefusalCode.BUSY: busy,
    RefusalCode.LIGHT_NOT_OFF: light_not_off,
    RefusalCode.PROGRAM_ENDING: ending,
    RefusalCode.NOT_ACKNOWLEDGED: not_acknowledged,
    RefusalCode.FOLDER_GONE: folder_gone,
    RefusalCode.STORAGE: no_folder,
    RefusalCode.DISK_FULL: disk_full,
    RefusalCode.INTERLOCK_OPEN: door_open,
    RefusalCode.INTERLOCK_SILENT: interlock_silent,
    RefusalCode.ESTOP_OPEN: estop,
    RefusalCode.GENERATOR_FAULT: generator_fault,
    RefusalCode.GENERATOR_SILENT: generator_silent,
    RefusalCode.CAMERA_SILENT: camera_silent,
}
OF_THE_FORM: dict[RefusalCode, tuple[Situation | None, dict[str, Any]]] = {
    RefusalCode.CURRENT: (None, {"current_a": {"view1": 5, "view2": 28}}),
    RefusalCode.TIMING: (None, {"separation_ns": 2500}),
    RefusalCode.NETWORK: (thin_wire, {}),
    RefusalCode.STAGE: (None, {"kind": "calibration", "stage_z_mm": "0"}),
    RefusalCode.REFERENCES: (None, {"references": ["nothing"]}),
    RefusalCode.REFERENCE_CAMERA: (other_camera, {"references": ["of-another-camera"]}),
    RefusalCode.CALIBRATION_UNKNOWN: (None, {"calibration": "nothing"}),
    RefusalCode.CALIBRATION_DAMAGED: (torn, {"calibration": "torn"}),
    RefusalCode.CALIBRATION_SIZE: (other_size, {"calibration": "small"}),
    RefusalCode.RECIPE: (calibrated, {"droplets": True}),
}
"""What stands in the form, and nothing on the rig speaks against."""


@contextmanager
def judged_form(server: Serving, **values: Any) -> Iterator[tuple[FormJudge, dict[str, Any]]]:
    """What is shown of a form that has these values, and the plan that its button starts."""
    context = server.app.state.context
    with TemporaryDirectory() as folder:
        draft = DraftStore(Path(folder) / "draft.json", server.services.config, server.services.events)
        draft.values |= FORM | values
        judge = FormJudge(context, draft)
        context.desk.look()
        asyncio.run(judge.refresh())
        yield judge, draft_plan(draft.values).model_dump(mode="json")


def start(server: Serving, plan: dict[str, Any]) -> dict[str, Any]:
    """The problem that a start is answered with."""
    answer = server.http.post("/api/runs", json=plan)
    assert answer.status_code >= 400, answer.text
    return dict(answer.json())


def judge(server: Serving, plan: dict[str, Any]) -> dict[str, Any]:
    answer = server.http.post("/api/rig/readiness", json=plan)
    assert answer.status_code == 200, answer.text
    return dict(answer.json())


def test_every_reason_of_the_catalogue_is_tried_here_and_has_a_remedy() -> None:
    assert {*OF_THE_RIG, *OF_THE_FORM} == set(RefusalCode) == set(REMEDIES)


@pytest.mark.parametrize("code", OF_THE_RIG)
def test_a_start_is_refused_for_the_reason_that_the_rig_is_not_ready(
    server: Serving, monkeypatch: pytest.MonkeyPatch, code: RefusalCode
) -> None:
    with OF_THE_RIG[code](server, monkeypatch), judged_form(server) as (form, plan):
        shown, bar = server.http.get("/api/rig/readiness").json(), form.state(ANN)
        refusal, judged = start(server, plan), judge(server, plan)
    assert shown["state"] != "ready"
    assert code in [reason["code"] for reason in shown["reasons"]]
    first = shown["reasons"][0]
    assert (refusal["code"], refusal["remedy"]) == (first["code"], first["remedy"])
    assert refusal["detail"] == first["text"]
    assert (judged["ready"], judged["reasons"][0]["code"]) == (False, first["code"])
    assert (bar.state == RigWord.READY, bar.reasons[0].code) == (False, first["code"])


@pytest.mark.parametrize("code", OF_THE_FORM)
def test_a_start_is_refused_for_the_reason_that_every_page_tells_of_its_form(
    server: Serving, monkeypatch: pytest.MonkeyPatch, code: RefusalCode
) -> None:
    situation, values = OF_THE_FORM[code]
    with ExitStack() as stack:
        if situation is not None:
            stack.enter_context(situation(server, monkeypatch))
        form, plan = stack.enter_context(judged_form(server, **values))
        assert server.http.get("/api/rig/readiness").json()["state"] == "ready"
        judged, bar, refusal = judge(server, plan), form.state(ANN), start(server, plan)
    assert [reason["code"] for reason in judged["reasons"]] == [code]
    assert (refusal["code"], refusal["detail"]) == (code, judged["reasons"][0]["text"])
    assert bar.text == f"NOT READY: {refusal['detail']}"
    assert [reason.code for reason in bar.reasons] == [code]


def test_who_may_not_start_reads_so_where_others_read_that_the_rig_is_ready(server: Serving) -> None:
    control = server.app.state.context.control
    control.require(ANN)
    with judged_form(server) as (form, plan):
        assert form.state(ANN).text == "READY"
        judged, refusal = judge(server, plan), start(server, plan)
        bob, viewer = (form.state(Visitor("b", "bob", role)) for role in (Role.OPERATOR, Role.VIEWER))
    assert (judged["ready"], judged["reasons"][0]["code"], refusal["code"]) == (False, "control_held", "control_held")
    assert bob.text == "NOT READY: ann holds control of this rig"
    assert viewer.text.startswith("NOT READY: bob may look and end the light")
    laboratory(server).open_door()
    with judged_form(server) as (form, _):
        bob, viewer = (form.state(Visitor("b", "bob", role)) for role in (Role.OPERATOR, Role.VIEWER))
    assert [reason.code for reason in bob.reasons][:2] == ["control_held", "interlock_open"]
    assert (viewer.reasons[0].code, viewer.reasons[-1].code) == ("interlock_open", "viewer")


def test_a_form_that_is_no_plan_or_was_looked_at_long_ago_is_not_ready(server: Serving, tmp_path: Path) -> None:
    context, now_s = server.app.state.context, [0.0]
    draft = DraftStore(tmp_path / "draft.json", server.services.config, server.services.events)
    form = FormJudge(context, draft, lambda: now_s[0])
    context.desk.look()
    assert form.state(ANN).text == "NOT READY: the rig is being looked at"
    asyncio.run(form.refresh())
    assert form.state(ANN).text == "READY"
    draft.set("shots", 0)
    asyncio.run(form.refresh())
    assert form.state(ANN).text == "NOT READY: a field of the form is empty or out of its limits"
    draft.set("shots", 1)
    asyncio.run(form.refresh())
    assert form.state(ANN).text == "READY"
    now_s[0] = 15.1
    assert form.state(ANN).state == RigWord.NOT_READY


def test_after_a_live_view_nothing_is_ready_before_rig_and_form_have_been_looked_at(
    server: Serving, tmp_path: Path
) -> None:
    context = server.app.state.context
    draft = DraftStore(tmp_path / "draft.json", server.services.config, server.services.events)
    form = FormJudge(context, draft)
    assert server.http.put("/api/rig/live", json={"rate_hz": 10, "pulse": None}).status_code == 200
    eventually(lambda: context.desk.look().state == RigWord.LIVE, "a live view goes on")
    asyncio.run(form.refresh())
    assert form.state(ANN).state == RigWord.LIVE
    acquisition(server).end_live()
    eventually(lambda: acquisition(server).status().resting, "the live view has ended")
    assert (form.state(ANN).text, form.state(ANN).reasons) == ("NOT READY: the rig is being looked at", (UNSEEN,))
    context.desk.look()
    assert form.state(ANN).text == "NOT READY: the rig is being looked at"
    assert "a live view goes on: a start ends it" in [check.text for check in form.checks(ANN)]
    asyncio.run(form.refresh())
    assert form.state(ANN).text == "READY"
    assert "at rest" in [check.text for check in form.checks(ANN)]


def test_of_several_reasons_a_start_names_the_one_that_is_told_first(
    server: Serving, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every two reasons of the rig that can be there together, and one of the plan."""
    together = (
        RefusalCode.DISK_FULL,
        RefusalCode.INTERLOCK_OPEN,
        RefusalCode.GENERATOR_FAULT,
        RefusalCode.INTERLOCK_SILENT,
        RefusalCode.FOLDER_GONE,
    )
    for pair in itertools.combinations(together, 2):
        with monkeypatch.context() as patch, ExitStack() as stack:
            for code in pair:
                stack.enter_context(OF_THE_RIG[code](server, patch))
            plan = plan_of(references=["nothing"])
            judged, refusal = judge(server, plan), start(server, plan)
        codes = [reason["code"] for reason in judged["reasons"]]
        assert refusal["code"] == codes[0]
        assert {RefusalCode.REFERENCES} < set(codes), f"{pair}: {codes}"
        laboratory(server).generator.clear()


def test_a_rig_that_is_ready_starts(server: Serving) -> None:
    use_a_calibration(server)
    assert server.http.get("/api/rig/readiness").json() == {
        "state": "ready",
        "text": "READY",
        "reasons": [],
        "eta_s": None,
    }
    judged = judge(server, plan_of())
    assert (judged["ready"], judged["reasons"]) == (True, [])
    _, status = server.run_to_its_end(plan_of())
    assert status.outcome == "completed"


def test_while_a_run_is_under_way_its_progress_is_told_and_no_device_is_asked(
    server: Serving, monkeypatch: pytest.MonkeyPatch
) -> None:
    server.http.post("/api/runs", json=plan_of(shots=1000, rate_hz=10.0))
    eventually(lambda: acquisition(server).status().shots_recorded > 3, "shots are recorded")
    asked, interlock = raising(AssertionError("asked")), laboratory(server).interlock
    is_closed = interlock.is_closed  # the run itself goes on to look at it
    own = "run-guard"
    monkeypatch.setattr(interlock, "is_closed", lambda: is_closed() if current_thread().name == own else asked())
    state = server.http.get("/api/rig/readiness").json()
    monkeypatch.undo()
    assert state["state"] == "acquiring"
    assert state["text"].startswith("ACQUIRING ")
    assert [reason["code"] for reason in state["reasons"]] == ["busy"]
    assert state["eta_s"] > 10
    server.http.post("/api/rig/abort")
    server.wait()
