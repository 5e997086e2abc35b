"""The pages Run and Calibrate, and who may use them; headless Chromium."""

import json
import re
import shutil
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, Locator, Page, expect

from server.lab.tasks import calibrate_run
from server.web.ui.draft import first_draft
from tests.support.desk import PULSE, choose_calibration, laboratory, picture
from tests.support.operator import go_to, press_for_light
from tests.support.server_process import eventually
from tests.support.serving import Serving, plan_of

pytestmark = pytest.mark.timeout(900)

ANN = {"Tomoshadow-Operator": "ann@lab"}


@pytest.fixture
def tab(page: Page, server: Serving) -> Page:
    page.set_viewport_size({"width": 1280, "height": 900})
    page.goto(f"{server.http.base_url}/run")
    expect(page.get_by_role("status", name="rig state").locator(".rig-known")).to_have_text("READY")
    return page


def control(page: Page) -> Locator:
    return page.get_by_role("button", name=re.compile("^control: "))


def row(page: Page, name: str) -> Locator:
    return page.get_by_role("region", name="Pre-flight").get_by_role("listitem", name=name)


def test_the_first_action_takes_control_and_a_take_over_is_seen(tab: Page, server: Serving) -> None:
    expect(control(tab)).to_have_text(re.compile("free"))
    tab.get_by_label("Shots", exact=True).fill("2")
    press_for_light(tab.get_by_role("button", name="Start run"))
    expect(control(tab)).to_have_text(re.compile("you"))
    server.wait()
    server.http.put("/api/rig/control", headers=ANN)
    expect(tab.get_by_role("alert").filter(has_text="ann@lab has taken control")).to_be_visible()
    expect(tab.get_by_role("button", name="Start run")).to_be_disabled()
    expect(row(tab, "Control")).to_contain_text("ann@lab holds control")
    control(tab).click()
    tab.get_by_role("button", name="Take control").click()
    expect(control(tab)).to_have_text(re.compile("you"))
    expect(tab.get_by_role("button", name="Start run")).to_be_enabled()


def test_why_a_click_was_refused_stays_to_be_read_whatever_is_judged_meanwhile(tab: Page, server: Serving) -> None:
    tab.evaluate("window.desk.ticket = () => ({})")
    tab.get_by_role("button", name="Start run").click()
    refusal = tab.get_by_role("region", name="New run").get_by_role("alert")
    expect(refusal).to_contain_text("this page had not heard the server yet: nothing was started")
    tab.get_by_label("Shots", exact=True).fill("3")
    expect(row(tab, "Disk")).to_contain_text("2 s at")
    expect(refusal).to_contain_text("nothing was started")
    expect(refusal).to_have_text("")
    assert server.services.acquisition.status().run_id is None


def test_who_does_not_hold_control_changes_the_light_nowhere(tab: Page, server: Serving) -> None:
    go_to(tab, "Live")
    current = tab.get_by_label("LED view1 / A")
    expect(current).to_be_enabled()
    server.http.put("/api/rig/control", headers=ANN)
    expect(current).to_be_disabled()
    why = "ann@lab holds control of this rig: the hand in the bar takes it over"
    for name in ("Live", "Shoot one", "Set to half range"):
        expect(tab.get_by_role("button", name=name, exact=True)).to_be_disabled()
        expect(tab.get_by_role("button", name=name, exact=True)).to_have_attribute("title", why)
    expect(tab.get_by_role("slider", name="LED view1 current")).to_have_attribute("aria-disabled", "true")
    go_to(tab, "Run")
    expect(tab.locator(".q-field--disabled").filter(has_text="Template")).to_be_visible()
    expect(tab.get_by_role("button", name="Start run")).to_have_attribute("title", why)
    server.free_control()
    expect(tab.get_by_role("button", name="Start run")).not_to_have_attribute("title", re.compile("."))


def test_a_change_in_one_tab_appears_in_the_other(tab: Page, browser: Browser, server: Serving) -> None:
    context = browser.new_context()
    other = context.new_page()
    other.goto(f"{server.http.base_url}/run")
    tab.get_by_label("Name", exact=True).fill("typed in one tab")
    expect(other.get_by_label("Name", exact=True)).to_have_value("typed in one tab")
    other.get_by_label("Shots", exact=True).fill("17")
    expect(tab.get_by_label("Shots", exact=True)).to_have_value("17")
    other.get_by_label("LED view2 / A").fill("7.5")
    expect(tab.get_by_label("LED view2 / A")).to_have_value("7.5")
    tab.reload()
    expect(tab.get_by_label("Name", exact=True)).to_have_value("typed in one tab")
    expect(tab.get_by_label("LED view2 / A")).to_have_value("7.5")
    context.close()


def test_two_tabs_that_change_the_form_in_one_moment_show_both_changes(
    tab: Page, browser: Browser, server: Serving
) -> None:
    context = browser.new_context()
    other = context.new_page()
    other.goto(f"{server.http.base_url}/run")
    expect(other.get_by_label("Shots", exact=True)).to_have_value("10")
    for number in range(11, 15):
        tab.get_by_label("Name", exact=True).fill(f"day {number}")
        other.get_by_label("Shots", exact=True).fill(str(number))
        expect(other.get_by_label("Name", exact=True)).to_have_value(f"day {number}")
        expect(tab.get_by_label("Shots", exact=True)).to_have_value(str(number))
    context.close()


def test_the_live_page_shows_the_light_that_another_tab_has_changed(
    tab: Page, browser: Browser, server: Serving
) -> None:
    context = browser.new_context()
    live = context.new_page()
    live.goto(f"{server.http.base_url}/live")
    expect(live.get_by_label("Pulse width / ns")).to_have_value("1000")
    tab.get_by_label("Pulse width / ns").fill("900")
    tab.get_by_label("LED view2 / A").fill("7.5")
    expect(live.get_by_label("Pulse width / ns")).to_have_value("900")
    expect(live.get_by_label("LED view2 / A")).to_have_value("7.5")
    expect(live.get_by_role("slider", name="LED view2 current")).to_have_attribute("aria-valuenow", "7.5")
    context.close()


def test_the_pre_flight_list_has_figures_and_follows_form_and_rig(tab: Page, server: Serving) -> None:
    tab.get_by_label("Shots", exact=True).fill("1200")
    tab.get_by_label("Rate / Hz").fill("4")
    expect(row(tab, "Disk")).to_have_text(re.compile(r"GB of .* GB free; 5\.0 min at 4 Hz"))
    expect(row(tab, "Cameras")).to_contain_text("4 answer")
    laboratory(server).open_door()
    expect(row(tab, "Interlock")).to_contain_text("the interlock is open")
    expect(row(tab, "Interlock")).to_contain_text("close the door")
    laboratory(server).close_door()
    expect(row(tab, "Interlock")).to_contain_text("closed")
    tab.get_by_label("Rate / Hz").fill("99")
    expect(row(tab, "Timing")).to_contain_text("the limit of the cameras")
    tab.get_by_label("Rate / Hz").fill("4")


def test_what_no_device_knows_travels_with_the_run(tab: Page, server: Serving) -> None:
    tab.get_by_role("button", name="Background").click()
    tab.get_by_label("Shots", exact=True).fill("1")
    for label, text in (("Operator", "ann"), ("Fluid", "water"), ("Nozzle", "N 3"), ("Pressure / bar", "40")):
        tab.get_by_label(label).fill(text)
    tab.get_by_label("Remark").fill("windows cleaned")
    press_for_light(tab.get_by_role("button", name="Start run"))
    expect(tab.get_by_role("status", name="run counts")).to_have_text("1 / 1 shot recorded, 1 valid")
    run_id = server.wait().run_id
    notes = server.http.get(f"/api/runs/{run_id}/header").json()["notes"]
    wanted = {"operator": "ann", "fluid": "water", "nozzle": "N 3", "pressure_bar": 40, "remark": "windows cleaned"}
    assert wanted.items() <= notes.items()


def test_a_form_is_kept_under_a_name_and_a_torn_one_is_set_aside(tab: Page, server: Serving) -> None:
    folder = server.services.data_dir / "templates"
    tab.get_by_label("Shots", exact=True).fill("123")
    tab.get_by_role("button", name="keep as a template").click()
    tab.get_by_label("Save as").fill("long run")
    tab.get_by_role("button", name="Save template").click()
    eventually(lambda: (folder / "long run.json").is_file(), "the template is in its folder")
    (folder / "torn.json").write_text('{"shots": ')
    tab.get_by_label("Shots", exact=True).fill("4")
    tab.reload()
    tab.get_by_role("combobox", name="Template").click()
    tab.get_by_role("option", name="long run").click()
    expect(tab.get_by_label("Shots", exact=True)).to_have_value("123")
    eventually(lambda: bool(list(folder.glob("torn.json.damaged-*"))), "the torn one is set aside")


def test_a_template_is_neither_replaced_nor_removed_unasked(tab: Page, server: Serving) -> None:
    file = server.services.data_dir / "templates" / "kept.json"
    save_template(tab, "kept", shots=12)
    eventually(file.is_file, "the template is in its folder")
    save_template(tab, "kept", shots=34)
    asked = tab.get_by_role("alertdialog", name="are you sure")
    expect(asked).to_contain_text("Replace the template kept?")
    asked.get_by_role("button", name="Keep it").click()
    expect(asked).to_be_hidden()
    assert json.loads(file.read_text())["shots"] == 12
    tab.get_by_role("button", name="Save template").click()
    asked.get_by_role("button", name="Replace").click()
    eventually(lambda: json.loads(file.read_text())["shots"] == 34, "it is replaced")
    tab.get_by_role("combobox", name="Template").click()
    tab.get_by_role("option", name="kept").click()
    tab.get_by_role("button", name="keep as a template").click()
    tab.get_by_role("button", name="Remove the chosen one").click()
    expect(asked).to_contain_text("Remove the template kept?")
    assert file.is_file()
    asked.get_by_role("button", name="Remove").click()
    eventually(lambda: not file.exists(), "it is removed")


def save_template(page: Page, name: str, shots: int) -> None:
    page.get_by_label("Shots", exact=True).fill(str(shots))
    page.get_by_role("button", name="keep as a template").click()
    page.get_by_label("Save as").fill(name)
    page.get_by_role("button", name="Save template").click()


def test_a_browser_names_page_rig_and_state_of_a_tab(tab: Page, server: Serving) -> None:
    rig = server.services.config.name
    expect(tab).to_have_title(f"READY · Run · {rig}")
    go_to(tab, "Calibrate")
    expect(tab).to_have_title(f"READY · Calibrate · {rig}")
    laboratory(server).open_door()
    expect(tab).to_have_title(f"NOT READY · Calibrate · {rig}")
    laboratory(server).cameras["view2"].is_lost = True
    expect(tab).to_have_title(f"NOT READY, 1 alarm · Calibrate · {rig}")
    laboratory(server).cameras["view2"].is_lost = False


def test_what_speaks_against_the_form_is_told_on_every_page_and_leads_to_it(tab: Page, server: Serving) -> None:
    go_to(tab, "Run")
    tab.get_by_label("Rate / Hz").fill("99")
    go_to(tab, "Runs")
    state = tab.get_by_role("status", name="rig state")
    expect(state).to_contain_text("NOT READY: rate_hz")
    server.http.put("/api/rig/control", headers=ANN)
    expect(state).to_contain_text("NOT READY: ann@lab holds control")
    server.free_control()
    to_form = tab.get_by_role("link", name="to the form")
    to_form.click()
    tab.get_by_label("Rate / Hz").fill("4")
    expect(state.locator(".rig-known")).to_have_text("READY")
    expect(to_form).to_be_hidden()


def test_what_is_made_of_every_shot_is_what_the_page_shows(tab: Page, server: Serving) -> None:
    choose_calibration(server)
    tab.reload()  # the page may still be told that somebody held control for a moment, which closes a list
    tab.get_by_role("button", name="Sample").click()
    tab.get_by_label("Shots", exact=True).fill("1")
    tab.get_by_label("Volumes", exact=True).click()
    tab.get_by_role("option", name="by MINLOS").click()
    expect(row(tab, "Recipe")).to_contain_text("volumes by MINLOS, accuracy nominal (recipe ")
    press_for_light(tab.get_by_role("button", name="Start run"))
    made = tab.get_by_role("status", name="made by itself")
    expect(made).to_contain_text("Of every shot: volumes by MINLOS")
    run_id = server.wait().run_id
    eventually(lambda: jobs_of(server, run_id) != [], "a volume is asked for")
    assert {job["settings"]["method"] for job in jobs_of(server, run_id)} == {"minlos"}
    box = tab.get_by_role("textbox", name="Box of the droplets / mm")
    expect(box).to_be_hidden()
    tab.get_by_role("checkbox", name="Droplets too").click()
    expect(row(tab, "Recipe")).to_contain_text("droplets")  # which need a background, and another test may have one
    expect(tab.get_by_text("which holds all of the spray at its height")).to_be_visible()
    box.fill("0:1")
    expect(row(tab, "Recipe")).to_contain_text("paper.json")  # that has to tell the pixels of a box, and cannot
    box.fill("")
    expect(row(tab, "Recipe")).not_to_contain_text("paper.json")
    tab.get_by_role("checkbox", name="Droplets too").click()
    tab.get_by_label("Volumes", exact=True).click()
    tab.get_by_role("option", name="none").click()
    expect(row(tab, "Recipe")).to_contain_text("nothing is made by itself")


def jobs_of(server: Serving, run_id: str | None) -> list[dict[str, Any]]:
    jobs = server.http.get("/api/jobs", params={"run_id": run_id or ""}).json()
    return [job for job in jobs if job["kind"] == "reconstruction"]


def test_a_chosen_calibration_whose_file_is_gone_gives_way_to_no_other(tab: Page, server: Serving) -> None:
    folder = server.services.data_dir / "calibrations"
    for name in ("lens", "paper"):
        choose_calibration(server, name)
    tab.reload()  # the page may still be told that somebody held control for a moment, which closes a list
    tab.get_by_role("button", name="Sample").click()
    tab.get_by_role("combobox", name="Calibration; none: current").click()
    tab.get_by_role("option", name="lens", exact=True).click()
    expect(row(tab, "Calibration")).to_contain_text("lens")
    (folder / "lens.json").unlink()
    server.run_to_its_end(plan_of(kind="dark", shots=1, pulse=PULSE))  # lists are read again
    server.free_control()
    expect(tab.get_by_role("region", name="New run").get_by_text("lens: is gone")).to_be_visible()
    expect(row(tab, "Calibration")).to_contain_text("there is no calibration 'lens'")
    tab.get_by_role("combobox", name="Calibration; none: current").click()
    tab.get_by_role("option", name="paper (current)").click()
    expect(tab.get_by_role("region", name="New run").get_by_text("lens: is gone")).to_have_count(0)


def test_a_kind_brings_its_name(tab: Page) -> None:
    name = tab.get_by_label("Name", exact=True)
    name.fill("spray")
    tab.get_by_role("button", name="Dark", exact=True).click()
    expect(name).to_have_value("dark")
    tab.get_by_role("button", name="Sample").click()
    expect(name).to_have_value("spray")


def test_a_run_shows_its_shots_and_why_one_is_invalid_and_what_it_waits_for(tab: Page, server: Serving) -> None:
    laboratory(server).cameras["view2"].lost = {laboratory(server).generator.fired + 2}
    plan = plan_of(kind="dark", shots=100, rate_hz=0.5, pulse=PULSE, refire_quota=0)
    server.http.post("/api/runs", json=plan)
    strip = tab.get_by_role("list", name="shots")
    expect(strip.get_by_role("listitem", name="shot 0: valid")).to_be_visible()
    first = tab.get_by_role("group", name="newest shots").get_by_role("img", name="shot 0")
    expect(first).to_have_js_property("naturalWidth", 128)
    expect(tab.get_by_label("run progress")).to_have_attribute("aria-valuenow", re.compile(r"^0\.0\d"))
    invalid = strip.get_by_role("listitem", name=re.compile("^shot 1: INVALID"))
    expect(invalid).to_have_attribute("aria-label", "shot 1: INVALID, no exposure B of view2")
    expect(tab.get_by_role("status", name="invalid shots")).to_contain_text("shot 1: no exposure B of view2")
    waits = tab.get_by_role("status", name="waits for")
    expect(waits).to_have_text(re.compile(r"^waits for the time of shot \d, \d\.\d s$"))
    expect(tab.get_by_role("status", name="run counts")).to_contain_text("left")
    picture(tab, "run-acquiring")
    tab.reload()
    expect(first).to_have_js_property("naturalWidth", 128)
    expect(tab.get_by_role("group", name="newest shots").get_by_role("img", name="shot 1")).to_be_visible()


def test_the_rail_ticks_what_is_done(tab: Page, server: Serving) -> None:
    def done(title: str) -> Locator:
        return tab.get_by_role("link", name=title, exact=True).get_by_label(re.compile("^done: "))

    expect(done("Rig")).to_be_visible()
    for title in ("Live", "Calibrate", "Run", "Results", "Runs"):
        expect(done(title)).to_be_hidden()
    run_id, _ = server.run_to_its_end(plan_of(kind="dark", shots=1, pulse=PULSE))
    for title in ("Live", "Run", "Runs"):
        expect(done(title)).to_be_visible()
    shutil.rmtree(server.services.data_dir / run_id)
    expect(done("Runs")).to_be_hidden()


def test_references_stay_as_they_are_and_a_newer_one_is_only_told(tab: Page, server: Serving) -> None:
    background = plan_of(
        kind="background", shots=1, pulse={"current_a": first_draft(server.services.config)["current_a"]}
    )
    first, _ = server.run_to_its_end(background)
    tab.get_by_role("button", name="Sample").click()
    chosen = tab.get_by_role("region", name="New run").locator(".q-chip")
    expect(chosen.filter(has_text="background")).to_have_count(1)
    pinned = chosen.filter(has_text="background").inner_text()
    second, _ = server.run_to_its_end(background)
    assert first != second
    expect(row(tab, "References")).to_contain_text(f"a newer background exists: {second}")
    assert chosen.filter(has_text="background").inner_text() == pinned
    tab.get_by_role("button", name="Use the newest").click()
    expect(chosen.filter(has_text=second)).to_have_count(1)


def test_dark_or_light_is_as_the_system_has_it_until_somebody_chooses(browser: Browser, server: Serving) -> None:
    context = browser.new_context(color_scheme="dark")
    page = context.new_page()
    page.goto(str(server.http.base_url))
    expect(page.locator("body")).to_have_class(re.compile("body--dark"))
    page.emulate_media(color_scheme="light")
    expect(page.locator("body")).to_have_class(re.compile("body--light"))
    page.get_by_role("button", name="dark or light").click()
    expect(page.locator("body")).to_have_class(re.compile("body--dark"))
    page.reload()
    expect(page.locator("body")).to_have_class(re.compile("body--dark"))
    context.close()


def test_a_target_run_becomes_the_current_calibration(page: Page, server: Serving) -> None:
    run_id, _ = server.run_to_its_end(plan_of(kind="calibration", shots=1, pulse=PULSE))
    page.set_viewport_size({"width": 1280, "height": 900})
    page.goto(f"{server.http.base_url}/calibrate")
    page.get_by_label("Kind of camera").click()
    page.get_by_role("option", name=re.compile("^polynomial")).click()
    page.get_by_role("region", name="Calibration runs").get_by_role("button", name="Calibrate").click()
    made = page.get_by_role("region", name="Calibrations").get_by_role("row", name=re.compile(f"{run_id}-polynomial"))
    made.get_by_role("button", name="Use").click()
    expect(made).to_contain_text("(current)")
    expect(page.get_by_role("status", name="current calibration")).to_contain_text(f"{run_id}-polynomial")


def test_a_calibration_shows_its_planes_its_pictures_and_why_it_is_not_used(page: Page, server: Serving) -> None:
    folder = server.services.data_dir / "calibrations"
    document = calibrate_kept_run(folder / "kept.json")
    for view in document["views"].values():
        view |= {"verdict": "refuse", "reasons": ["hold-out error 7.1 px, more than 1 px"]}
    (folder / "bad.json").write_text(json.dumps(document))
    page.set_viewport_size({"width": 1280, "height": 900})
    page.goto(f"{server.http.base_url}/calibrate")
    rows = page.get_by_role("region", name="Calibrations").get_by_role("row")
    rows.filter(has_text="bad").get_by_role("button", name="Use").click()
    refusal = page.get_by_role("alert", name="why it is not used")
    expect(refusal).to_contain_text("view1 is refused: hold-out error 7.1 px, more than 1 px")
    rows.filter(has_text="kept").get_by_role("button", name="Show").click()
    shown = page.get_by_role("region", name="Calibration", exact=True)
    expect(shown.get_by_role("table", name="residuals by plane and view")).to_contain_text("view1")
    image = shown.get_by_role("img", name="picture of the calibration")
    expect(image).to_have_attribute("src", re.compile("kept/pictures/errors.png"))
    shown.get_by_role("combobox", name="Picture").click()
    page.get_by_role("option", name="Corners, plane 2").click()
    expect(image).to_have_attribute("src", re.compile("grid-2.png"))
    for width in (800, 1280, 1920):
        page.set_viewport_size({"width": width, "height": 1000})
        for shade in ("dark", "light"):
            page.emulate_media(color_scheme=shade)
            picture(page, f"calibrate-{width}-{shade}")
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth"), "the page is wider than the window"


def calibrate_kept_run(file: Path) -> Any:
    """What a job makes of a small run of an earlier version: a calibration of three views, and its pictures."""
    (run_dir,) = (Path(__file__).parents[1] / "fixtures" / "v0.1.0" / "runs").glob("*-target")
    job = {"run_dir": str(run_dir), "settings": {"model": "polynomial"}, "calibration_file": str(file)}
    calibrate_run(job, lambda: False)
    return json.loads(file.read_text())


@pytest.mark.parametrize("shade", ["dark", "light"])
@pytest.mark.parametrize("width", [800, 1280, 1920])
def test_nothing_of_the_page_is_cut(page: Page, server: Serving, width: int, shade: Any) -> None:
    page.emulate_media(color_scheme=shade)
    page.set_viewport_size({"width": width, "height": 950})
    page.goto(f"{server.http.base_url}/run")
    expect(row(page, "Disk")).to_be_visible()
    picture(page, f"run-{width}-{shade}")
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth"), "the page is wider than the window"
    words = page.locator(".q-field__label, .check, .calibration, .rig-state, .control-text, .run-line")
    cut = words.evaluate_all(
        "found => found.filter(one => one.scrollWidth > one.clientWidth + 1).map(one => one.innerText)"
    )
    assert cut == []
