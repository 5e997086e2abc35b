"""What is always in sight: a page that never lies, whatever happens to network and rig; headless Chromium."""

import re
import threading
from collections.abc import Iterator
from dataclasses import replace

import pytest
from playwright.sync_api import Browser, Locator, Page, Route, expect

from tests.support.cut_link import CutLink, cut_link
from tests.support.desk import PULSE, choose_calibration, laboratory, picture, start
from tests.support.operator import go_to, open_drawer, press_for_light
from tests.support.sampled_sprays import cone_shots, write_results
from tests.support.server_process import eventually
from tests.support.serving import Serving, plan_of

pytestmark = pytest.mark.timeout(900)

AWAY_S = 3.0
"""Longer than a request may be on its way."""


@pytest.fixture
def server(server: Serving) -> Serving:
    choose_calibration(server)
    return server


@pytest.fixture
def link(server: Serving) -> Iterator[CutLink]:
    with cut_link(server.port) as link:
        yield link


@pytest.fixture
def tab(browser: Browser, link: CutLink) -> Iterator[Page]:
    """A tab that sees the server through a wire that can be cut; what a browser says of that is no complaint."""
    context = browser.new_context(viewport={"width": 1600, "height": 950})
    page = context.new_page()
    page.goto(f"http://127.0.0.1:{link.port}")
    expect(rig_state(page)).to_have_text("READY")
    expect(page.get_by_role("status", name="connection")).to_have_text("connected")
    yield page
    link.mend()
    context.close()


def rig_state(page: Page) -> Locator:
    return page.get_by_role("status", name="rig state").locator(".rig-known")


def unknown(page: Page) -> Locator:
    return page.get_by_role("status", name="rig state").locator(".rig-unknown")


def press(page: Page, name: str) -> None:
    """Click as fast as a browser can, and even where a person could not any more."""
    page.get_by_role("button", name=name, exact=True).evaluate("button => button.click()")


def answer(page: Page) -> Locator:
    return page.get_by_role("alert", name="abort answer")


@pytest.mark.parametrize("buttons", [("Start run",), ("Shoot one", "Live")])
def test_a_click_that_waited_in_the_network_fires_no_light(
    tab: Page, link: CutLink, server: Serving, buttons: tuple[str, ...]
) -> None:
    before, run_id = laboratory(server).generator.fired, server.services.acquisition.status().run_id
    go_to(tab, "Run" if buttons == ("Start run",) else "Live")
    link.cut()
    for button in buttons:
        press(tab, button)
    expect(unknown(tab)).to_be_visible()
    for button in buttons:
        press(tab, button)
    threading.Event().wait(AWAY_S)
    link.mend()
    expect(rig_state(tab)).to_be_visible()
    threading.Event().wait(1.0)
    assert server.services.acquisition.status().resting
    assert (laboratory(server).generator.fired, server.services.acquisition.status().run_id) == (before, run_id)
    for number, button in enumerate(buttons):
        eventually(
            lambda: server.services.acquisition.status().resting, "the rig is at rest, which the page says later"
        )
        expect(rig_state(tab)).to_have_text("READY")
        tab.get_by_role("button", name=button, exact=True).click()
        await_shot(server, before + number)


def await_shot(server: Serving, before: int) -> None:
    """A click of now fires."""
    eventually(lambda: laboratory(server).generator.fired > before, f"there are more shots than {before}")


def test_without_a_beat_the_page_is_grey_and_locked_but_for_abort(tab: Page, link: CutLink, server: Serving) -> None:
    start(server)
    expect(rig_state(tab)).to_have_text(re.compile(r"^ACQUIRING \d+/1000, \d+:\d\d left$"))
    link.cut()
    expect(unknown(tab)).to_have_text(re.compile(r"^unknown since \d\d:\d\d:\d\d$"))
    expect(tab).to_have_title(re.compile("^UNKNOWN · Run · "))
    expect(tab.locator(".q-page-container")).to_have_attribute("inert", "")
    expect(tab.locator(".q-page-container")).to_have_css("filter", "grayscale(1)")
    expect(tab.locator(".alarm-strip")).to_have_attribute("inert", "")
    assert tab.locator(".abort-button").evaluate("button => button.closest('[inert]')") is None
    tab.get_by_role("button", name="ABORT").click()
    expect(answer(tab)).to_have_text(re.compile("light off confirmed.*; ended run "))
    assert server.wait().outcome == "aborted"
    link.mend()
    expect(rig_state(tab)).to_have_text("READY")
    expect(tab.locator(".q-page-container")).not_to_have_attribute("inert", "")
    expect(tab.get_by_label("run outcome")).to_have_text("aborted")


def test_after_an_outage_the_page_is_current_and_text_is_still_there(tab: Page, link: CutLink, server: Serving) -> None:
    tab.get_by_label("Name", exact=True).fill("typed before")
    expect(tab.get_by_role("region", name="Run", exact=True)).to_be_visible()
    draft = server.services.data_dir / "draft.json"
    eventually(lambda: draft.is_file() and "typed before" in draft.read_text(), "the text has reached the server")
    link.cut()
    expect(unknown(tab)).to_be_visible()
    run_id, _ = server.run_to_its_end(plan_of(kind="dark", name="meanwhile", shots=1, pulse=PULSE))
    laboratory(server).open_door()
    link.mend()
    expect(rig_state(tab)).to_have_text("NOT READY: door: the interlock is open")
    expect(tab.get_by_label("Name", exact=True)).to_have_value("typed before")
    go_to(tab, "Runs")
    expect(tab.get_by_role("region", name="Runs").get_by_text(run_id)).to_be_visible()


def test_abort_says_when_it_is_not_delivered_and_counts_when_it_is_late(browser: Browser, server: Serving) -> None:
    context = browser.new_context()
    page, held = context.new_page(), list[Route]()
    page.route(re.compile("/abort$"), lambda route: held.append(route))
    page.goto(str(server.http.base_url))
    expect(rig_state(page)).to_have_text("READY")
    start(server)
    page.get_by_label("Name", exact=True).focus()
    page.keyboard.press("F8")
    expect(answer(page)).to_have_text("NOT DELIVERED: use the hardware stop")
    assert server.services.acquisition.status().active
    assert len(held) == 2, "it goes two ways"
    held[0].continue_()
    late = re.compile(r"^light off confirmed at [\d:]{8}, \d+\.\d s after the click: ABORT was late")
    expect(answer(page)).to_have_text(late)
    assert server.wait().outcome == "aborted"
    context.close()


def test_abort_answers_when_nothing_runs(page: Page, server: Serving) -> None:
    page.goto(str(server.http.base_url))
    open_drawer(page)
    page.get_by_role("button", name="ABORT").click()
    # Its own port says what ended; the other way may be quicker, and does not.
    told = r"^light off confirmed at \d\d:\d\d:\d\d(; ended nothing|$)"
    expect(answer(page)).to_have_text(re.compile(told))
    expect(page.get_by_role("log")).to_contain_text("ABORT of nothing: no run was under way: light confirmed off")


def test_what_an_abort_confirmed_is_not_said_of_a_later_light(page: Page, server: Serving) -> None:
    page.clock.install()
    page.goto(str(server.http.base_url))
    page.get_by_role("button", name="ABORT").click()
    expect(answer(page)).to_have_text(re.compile("^light off confirmed"))
    page.clock.fast_forward("00:11")
    expect(answer(page)).to_be_hidden()


def test_the_rig_says_why_it_is_not_ready_and_the_form_too_until_it_is_mended(page: Page, server: Serving) -> None:
    page.goto(str(server.http.base_url))
    laboratory(server).open_door()
    expect(rig_state(page)).to_have_text("NOT READY: door: the interlock is open")
    page.get_by_role("button", name="why this state").click()
    reasons = page.get_by_role("region", name="reasons against a start")
    expect(reasons).to_contain_text("close the door")
    page.keyboard.press("Escape")
    refusal = page.get_by_role("region", name="New run").get_by_role("alert")
    expect(refusal).to_contain_text("the interlock is open (close the door)")
    laboratory(server).close_door()
    expect(rig_state(page)).to_have_text("READY")
    expect(refusal).to_have_text("")


def test_alarms_are_acknowledged_one_by_one(page: Page, server: Serving) -> None:
    page.goto(str(server.http.base_url))
    laboratory(server).cameras["view2"].is_lost = True
    laboratory(server).generator.trip("overcurrent")
    alarms = page.get_by_role("region", name="alarms")
    expect(alarms.locator(".alarm.stop")).to_have_count(2)
    picture(page, "alarms")
    alarms.get_by_role("button", name=re.compile("^Acknowledge view2")).click()
    expect(alarms.locator(".alarm.seen")).to_have_text(re.compile("view2"))
    expect(alarms.locator(".alarm.stop")).to_have_text(re.compile("pulse generator.*look for its reason"))
    alarms.get_by_role("button", name=re.compile("^Acknowledge pulse generator")).click()
    expect(alarms.locator(".alarm.stop")).to_have_count(0)
    laboratory(server).cameras["view2"].is_lost = False
    expect(alarms).to_be_hidden()


@pytest.mark.parametrize("width", [480, 800, 1280, 1920])
def test_the_bar_is_in_sight_at_every_width_dark_and_light(page: Page, server: Serving, width: int) -> None:
    page.set_viewport_size({"width": width, "height": 900})
    page.goto(str(server.http.base_url))
    open_drawer(page)
    expect(rig_state(page)).to_have_text("READY")
    lamps = page.get_by_role("status", name="sum of all lamps")
    if width <= 1500:
        expect(lamps).to_have_text("7 ok")
    else:
        expect(page.get_by_role("status", name=re.compile("^view1: ok"))).to_be_visible()
    for shade in ("light", "dark"):
        picture(page, f"bar-{width}-{shade}")
        page.get_by_role("button", name="dark or light").click()
    laboratory(server).open_door()
    laboratory(server).generator.trip("overcurrent")
    expect(page.locator(".alarm.stop")).to_have_count(1)
    if width <= 1500:
        expect(lamps).to_have_text("2 faults")
    page.get_by_role("log").scroll_into_view_if_needed()
    page.mouse.wheel(0, 3000)
    for part in (page.get_by_role("button", name="ABORT"), rig_state(page), page.locator(".alarm.stop")):
        expect(part).to_be_in_viewport(ratio=1)
    expect(page.get_by_text("SIMULATED")).to_be_in_viewport(ratio=1)
    expect(page.get_by_role("status", name="current calibration")).to_have_text(re.compile(r"^paper, \d+ (s|min) old$"))
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth"), "the page is wider than the window"
    picture(page, f"bar-{width}-trouble")


def test_a_current_calibration_whose_file_was_deleted_is_told_as_gone(page: Page, server: Serving) -> None:
    choose_calibration(server, "deleted")
    page.goto(str(server.http.base_url))
    done = page.get_by_role("link", name="Calibrate").get_by_label("done")
    expect(done).to_be_visible()
    (server.services.data_dir / "calibrations" / "deleted.json").unlink()
    expect(page.get_by_role("status", name="current calibration")).to_have_text("deleted, its file is gone")
    expect(done).to_be_hidden()


@pytest.mark.parametrize("width", [800, 1280, 1600])
def test_the_state_is_one_word_however_long_the_name_of_the_calibration(
    page: Page, server: Serving, width: int
) -> None:
    long = "20261129T171653-spray-pinhole-of-a-long-day"
    choose_calibration(server, long)
    page.set_viewport_size({"width": width, "height": 900})
    page.goto(str(server.http.base_url))
    expect(page.get_by_role("status", name="current calibration")).to_contain_text(long)
    expect(rig_state(page)).to_have_text("READY")
    box, calibration = rig_state(page).bounding_box(), page.get_by_role("status", name="current calibration")
    expect(calibration).to_have_attribute("title", long)
    expect(page.locator(".desk-name")).to_have_attribute("title", server.services.config.name)
    bar = page.locator(".desk-row").bounding_box()
    assert box is not None
    assert bar is not None
    assert box["height"] < 25, "the word is broken into two lines"
    assert bar["height"] < 65, "the bar grows with the name"
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth"), "the page is wider than the window"


@pytest.mark.parametrize("width", [800, 1280])
def test_no_words_of_the_page_are_cut(page: Page, server: Serving, width: int) -> None:
    page.set_viewport_size({"width": width, "height": 900})
    page.goto(str(server.http.base_url))
    go_to(page, "Live")
    live = page.get_by_role("region", name="Live", exact=True)
    press_for_light(live.get_by_role("button", name="Shoot one"))
    expect(live.get_by_role("button", name="Keep shot")).to_be_visible()
    open_drawer(page)
    words = page.locator(".q-field__label, [role=log] *, .live-caption")
    expect(page.get_by_role("log")).to_contain_text("single-shot: idle, 1 of 1 shot recorded, 1 valid")
    cut = words.evaluate_all(
        "found => found.filter(one => one.scrollWidth > one.clientWidth + 1).map(one => one.innerText)"
    )
    assert cut == []
    page.get_by_role("button", name="jobs and events").click()
    live.get_by_role("button", name="Keep shot").click()
    expect(live.get_by_role("button", name="Keep shot")).to_be_hidden()


def test_no_page_scrolls_sideways_beside_the_open_drawer(page: Page, server: Serving) -> None:
    choose_calibration(server, "a-calibration-with-quite-a-long-name-of-a-day")
    long_name = "a-run-with-quite-a-long-name-of-a-day-in-november"
    server.run_to_its_end(plan_of(kind="background", name=long_name, shots=1, pulse=PULSE))
    page.set_viewport_size({"width": 1280, "height": 900})
    page.goto(str(server.http.base_url))
    open_drawer(page)
    for title in ("Rig", "Live", "Calibrate", "Run", "Results", "Runs"):
        go_to(page, title)
        expect(page.locator(".desk-page .panel").first).to_be_visible()
        wide = page.locator(".desk-page, .desk-page .column").evaluate_all(
            "found => found.filter(one => one.scrollWidth > one.clientWidth + 1).length"
        )
        assert wide == 0, f"{title} is wider than its place"
        picture(page, f"drawer-{title}")


@pytest.mark.parametrize("path", ["nothing", "calibrate/none", "runs/one/two", "results/one/two"])
def test_at_an_address_that_is_none_there_are_bar_rail_and_abort(browser: Browser, server: Serving, path: str) -> None:
    context = browser.new_context()
    page = context.new_page()
    answer = page.goto(f"{server.http.base_url}/{path}")
    assert answer is not None
    assert answer.status == 404
    expect(page.get_by_text(f"There is no page /{path}")).to_be_visible()
    page.get_by_role("button", name="ABORT").click()
    expect(page.get_by_role("alert", name="abort answer")).to_have_text(re.compile("^light off confirmed"))
    go_to(page, "Runs")
    expect(page.get_by_role("region", name="Runs")).to_be_visible()
    context.close()


@pytest.mark.parametrize("width", [800, 1280])
def test_a_long_name_pushes_nothing_of_a_job_out_of_sight(page: Page, server: Serving, width: int) -> None:
    run_id, _ = server.run_to_its_end(plan_of(name="n" * 80, shots=1, pulse=PULSE))
    page.set_viewport_size({"width": width, "height": 900})
    page.goto(str(server.http.base_url))
    open_drawer(page)
    jobs = page.get_by_role("region", name="Processing")
    expect(jobs.get_by_role("cell", name=run_id).first).to_be_visible()
    table = jobs.locator(".q-table__middle")
    assert table.evaluate("table => table.scrollWidth <= table.clientWidth + 1")
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth"), "the page is wider than the window"
    page.goto(f"{server.http.base_url}/results/{run_id}")
    page.get_by_role("combobox", name="Run").hover()
    expect(page.get_by_role("tooltip")).to_have_text(f"{run_id} · sample")
    picture(page, f"long-name-{width}")


def test_jobs_and_events_are_found_by_words(page: Page, server: Serving) -> None:
    first, second = (server.run_to_its_end(plan_of(name=name, shots=1, pulse=PULSE))[0] for name in ("first", "second"))
    page.goto(str(server.http.base_url))
    open_drawer(page)
    log, jobs = page.get_by_role("log"), page.get_by_role("region", name="Processing")
    words = page.get_by_role("textbox", name="Filter jobs and events")
    expect(jobs.get_by_role("cell", name=first).first).to_be_visible()
    expect(log).to_contain_text(f"{first}: idle")
    words.fill("SECOND")
    expect(log).not_to_contain_text(first)
    expect(log).to_contain_text(f"{second}: idle")
    expect(jobs.get_by_role("cell", name=first)).to_have_count(0)
    expect(jobs.get_by_role("cell", name=second).first).to_be_visible()
    words.fill("")
    expect(log).to_contain_text(f"{first}: idle")
    expect(jobs.get_by_role("cell", name=first).first).to_be_visible()


def test_the_drawer_squeezes_no_narrow_page(page: Page, server: Serving) -> None:
    page.set_viewport_size({"width": 800, "height": 900})
    page.goto(str(server.http.base_url))
    before = page.locator(".desk-page").bounding_box()
    open_drawer(page)
    now = page.locator(".desk-page").bounding_box()
    assert before
    assert now
    assert (now["x"], now["width"]) == (before["x"], before["width"])


def test_what_shots_say_together_and_nothing_checks_is_on_the_page(page: Page, server: Serving) -> None:
    run_id, _ = server.run_to_its_end(plan_of(kind="dark", shots=1, pulse=PULSE))
    (shot,) = cone_shots(0, 1, 40)
    copies = [replace(shot, provenance={**shot.provenance, "shot": number}) for number in (0, 1)]
    measured = write_results(server.services.data_dir / run_id / "results" / "droplets-1", copies, run=run_id)
    (measured / "settings.json").write_text("{}")
    page.set_viewport_size({"width": 1280, "height": 900})
    page.goto(f"{server.http.base_url}/results/{run_id}")
    cells = page.get_by_role("region", name="Droplets", exact=True).get_by_role("cell")
    expect(cells.nth(5)).to_contain_text("has the very droplets of")
    expect(cells.nth(6)).to_contain_text("whether grey values are in proportion to light")
    picture(page, "droplets-told")
    box = cells.nth(6).locator(".verdict").bounding_box()
    assert box is not None
    assert box["height"] < 120


def test_many_reasons_of_droplets_make_no_row_of_the_height_of_the_page(page: Page, server: Serving) -> None:
    run_id, _ = server.run_to_its_end(plan_of(kind="dark", shots=1, pulse=PULSE))
    named = "a reason " * 21 + "more"
    measured = server.services.data_dir / run_id / "results" / named
    measured.mkdir(parents=True)
    (measured / "settings.json").write_text("{}")
    (measured / "shot_00000_droplets.h5").write_bytes(b"no HDF5")
    page.set_viewport_size({"width": 1280, "height": 900})
    page.goto(f"{server.http.base_url}/results/{run_id}")
    verdict = page.get_by_role("region", name="Droplets").get_by_role("cell").nth(5)
    expect(verdict).to_contain_text(named)
    box = verdict.bounding_box()
    assert box is not None
    assert box["height"] < 120
