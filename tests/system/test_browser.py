"""The operator's page in a real browser: headless Chromium, a real server, every device honest."""

import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from fastapi import FastAPI
from playwright.sync_api import Page, expect

from daq.run.events import ShotRecorded
from processing.calibration.calibration import Calibration
from processing.calibration.calibration_file import save_calibration
from server.lab.jobs.job import JobKind
from server.lab.services import Services
from server.lab.tasks import check_run
from server.web.app import create_app
from tests.server.web.test_api import wait_for_jobs
from tests.support.desk import PICTURES, PULSE, choose_calibration, serving_desk
from tests.support.drifting_run import DRIFT_PX, write_droplet_run
from tests.support.drifting_views import calibration_of, views
from tests.support.operator import VIEWS, drive_the_page, go_to, open_drawer, press_for_light
from tests.support.serving import Serving, plan_of, tell_nothing

pytestmark = pytest.mark.timeout(900)

DRIFTED = "drifted"


def check_drifted(job: dict[str, Any], should_stop: Callable[[], bool]) -> dict[str, Any]:
    """Work function: the product's check for the run with droplets in it."""
    return (check_run if Path(job["run_dir"]).name == DRIFTED else tell_nothing)(job, should_stop)


def build(services: Services) -> FastAPI:
    return create_app(replace(services, tasks={**services.tasks, JobKind.CHECK: check_drifted}))


@pytest.fixture
def server(tmp_path: Path) -> Iterator[Serving]:
    with serving_desk(tmp_path / "runs", build=build) as server:
        choose_calibration(server)
        yield server


def _take_picture(page: Page, name: str) -> None:
    if PICTURES:
        page.wait_for_timeout(1500)
        page.screenshot(path=f"{PICTURES}/{name}.png")


def test_an_operator_records_a_run_and_sees_its_volume(page: Page, server: Serving) -> None:
    drive_the_page(page, str(server.http.base_url), VIEWS, shots=5)
    expect(page.locator(".q-slider").first).to_have_css("overflow-y", "visible")
    _take_picture(page, "page-dark")
    page.get_by_role("button", name="dark or light").click()
    _take_picture(page, "page-light")
    page.set_viewport_size({"width": 480, "height": 950})
    _take_picture(page, "page-narrow")


def test_an_operator_looks_at_the_rig_live(page: Page, server: Serving) -> None:
    page.goto(str(server.http.base_url))
    open_drawer(page)
    go_to(page, "Live")
    live, state = page.get_by_role("region", name="Live"), page.get_by_role("status", name="rig state")
    live.get_by_label("Live / Hz").fill("50")
    live.get_by_role("button", name="Live", exact=True).click()
    expect(page.get_by_text("less than or equal to 10")).to_be_visible()
    live.get_by_label("Live / Hz").fill("10")
    live.get_by_role("button", name="Live", exact=True).click()
    expect(state).to_have_text("LIVE")
    caption = live.get_by_role("status", name="view1 newest shot")
    expect(caption).to_have_text(re.compile(r"shot \d+ · \d+\.\d s old · A \d+ % · B \d+ %"))
    _take_picture(page, "page-live")
    live.get_by_role("switch", name="Pulsed light").click()
    live.get_by_role("button", name="Apply").click()
    expect(caption).to_have_text(re.compile("A 0 % · B 0 %"))
    live.get_by_role("button", name="End live").click()
    expect(state).to_have_text("READY")
    expect(page.get_by_role("log")).to_contain_text("live, live view at 10 Hz, ambient light")
    expect(page.get_by_role("log")).to_contain_text("idle, ended by the operator")


def test_an_operator_takes_a_single_shot_and_keeps_it(page: Page, server: Serving) -> None:
    page.goto(str(server.http.base_url))
    go_to(page, "Live")
    live, runs = page.get_by_role("region", name="Live"), page.get_by_role("region", name="Runs")
    press_for_light(live.get_by_role("button", name="Shoot one"))
    expect(live.get_by_role("status", name="view1 newest shot")).to_have_text(re.compile("^shot 0 · "))
    go_to(page, "Runs")
    expect(runs.get_by_text("single-shot")).to_have_count(1)
    go_to(page, "Live")
    live.get_by_role("button", name="Keep shot").click()
    expect(live.get_by_role("button", name="Keep shot")).to_be_hidden()
    assert server.http.get("/api/rig/shot").json() == {"run_ids": []}


def test_a_drift_raises_an_alarm_and_a_larger_one_stops_reconstruction(page: Page, server: Serving) -> None:
    write_droplet_run(server.services.data_dir / DRIFTED)
    page.goto(str(server.http.base_url))
    open_drawer(page)
    alarm = page.get_by_role("region", name="alarms").locator(".alarm")
    expect(alarm).to_have_count(0)
    _reconstruct(server, "drifting", _calibration_off_by(0.45))
    expect(alarm).to_contain_text("CALIBRATION ALARM: view2 0.4")
    _take_picture(page, "page-calibration-alarm")
    _reconstruct(server, "moved", _calibration_off_by(2))
    expect(alarm).to_contain_text("RECONSTRUCTION STOPPED: view2 ")
    expect(alarm).to_contain_text("self-calibrate")
    expect(page.get_by_role("region", name="Processing").get_by_text("failed").first).to_be_visible()
    expect(page.get_by_role("log")).to_contain_text(f"calibration moved does not fit run {DRIFTED}")
    _take_picture(page, "page-calibration-stop")
    _reconstruct(server, "good", _calibration_off_by(0))
    expect(alarm).to_have_count(0)


def test_a_torn_draft_does_not_keep_the_page_from_opening(page: Page, server: Serving) -> None:
    (server.services.data_dir / "draft.json").write_text('{"shots": 7')
    page.goto(str(server.http.base_url))
    expect(page.get_by_role("button", name="Start run")).to_be_visible()
    (aside,) = server.services.data_dir.glob("draft.json.damaged-*")
    assert aside.read_text() == '{"shots": 7'


def test_a_reference_that_the_operator_chose_is_not_replaced_by_a_newer_one(page: Page, server: Serving) -> None:
    older, _ = server.run_to_its_end(plan_of(kind="dark", name="older", shots=1, pulse=PULSE))
    server.run_to_its_end(plan_of(kind="dark", name="proposed", shots=1, pulse=PULSE))
    page.goto(str(server.http.base_url))
    chosen = page.get_by_role("region", name="New run").locator(".q-chip")
    expect(chosen.filter(has_text="proposed")).to_have_count(1)
    page.get_by_label("Dark and background runs").click()
    page.get_by_role("option", name="dark: proposed").click()
    page.get_by_role("option", name="dark: older").click()
    page.keyboard.press("Escape")
    expect(chosen).to_have_text(re.compile("dark: older"))
    newer, _ = server.run_to_its_end(plan_of(kind="dark", name="newer", shots=1, pulse=PULSE))
    page.reload()
    expect(chosen).to_have_text(re.compile("dark: older"))
    page.get_by_label("Dark and background runs").click()
    expect(page.get_by_role("option", name="dark: newer")).to_be_visible()
    page.keyboard.press("Escape")
    assert (older, newer) == tuple(sorted((older, newer)))
    go_to(page, "Runs")
    for run_id in (older, newer):  # two runs may have one name
        expect(page.get_by_role("region", name="Runs").get_by_text(run_id)).to_be_visible()


def test_work_that_fails_has_a_red_lamp(page: Page, server: Serving) -> None:
    page.goto(str(server.http.base_url))
    server.services.events.publish_run_event(ShotRecorded('gone "far"', 0, valid=True))
    lamp = page.get_by_role(
        "status", name=re.compile("^automatic reconstruction: fault, .*'gone \"far\"' is no id of a run")
    )
    expect(lamp).to_be_visible()


def test_what_an_operator_chose_stays_and_what_another_page_chose_is_shown(page: Page, server: Serving) -> None:
    server.run_to_its_end(plan_of(name="spray", shots=5, pulse=PULSE))
    wait_for_jobs(server, 5)
    server.run_to_its_end(plan_of(shots=1, pulse=PULSE))
    wait_for_jobs(server, 6)
    server.free_control()
    page.goto(str(server.http.base_url))
    open_drawer(page)
    go_to(page, "Results")
    page.get_by_role("combobox", name="Run", exact=True).click()
    page.get_by_role("option", name=re.compile("-spray")).click()
    expect(page.get_by_label("Result set", exact=True).first).to_have_value(re.compile("MLOS"))
    shot = page.get_by_role("status", name="shot shown")
    expect(shot).to_have_text("shot 4 (5 of 5)")  # of the run that was chosen, not of the one before
    page.get_by_role("slider", name="shot", exact=True).locator("[tabindex='0']").first.focus()
    page.keyboard.press("ArrowLeft")
    picked = re.compile("^shot 3 ")
    expect(shot).to_have_text(picked)
    server.http.put("/api/calibrations/current", json={"id": "paper"})
    expect(page.get_by_role("log")).to_contain_text("paper is the current calibration")
    server.run_to_its_end(plan_of(kind="dark", name="last", shots=1, pulse=PULSE))
    expect(page.get_by_role("log")).to_contain_text("-last: idle")
    expect(shot).to_have_text(picked)
    page.get_by_role("button", name="Reconstruct", exact=True).click()
    expect(page.get_by_text("nothing to do: it is done already")).to_be_visible()


def _calibration_off_by(error_px: float) -> Calibration:
    """Calibration of the run with droplets whose view2 is wrong by so much."""
    cameras = views()
    matrix = cameras[1].camera_matrix.copy()
    matrix[0, 2] += DRIFT_PX - error_px
    cameras[1] = replace(cameras[1], camera_matrix=matrix)
    return calibration_of(cameras)


def _reconstruct(server: Serving, name: str, calibration: Calibration) -> None:
    save_calibration(calibration, server.services.data_dir / "calibrations" / f"{name}.json")
    server.http.put("/api/calibrations/current", json={"id": name})
    server.http.post("/api/jobs", json={"run_id": DRIFTED})
