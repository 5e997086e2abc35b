"""The pages Rig and Live in a real browser: what an operator needs to align cameras and to set light."""

import math
import re
import threading

import pytest
from playwright.sync_api import Browser, Locator, Page, WebSocket, expect

from server.cli.benchmarks.browsed import drag, first_page
from tests.support.desk import laboratory, picture, show_spray
from tests.support.live_shots import save_droplet_calibration
from tests.support.operator import VIEWS, go_to, open_drawer, press_for_light
from tests.support.server_process import eventually
from tests.support.serving import Serving, plan_of

pytestmark = pytest.mark.timeout(600)


@pytest.fixture
def server(server: Serving) -> Serving:
    show_spray(server)
    return server


def open_live(page: Page, server: Serving) -> Locator:
    page.goto(f"{server.http.base_url}/live")
    return page.get_by_role("region", name="Live", exact=True)


def show_live(page: Page, server: Serving, rate_hz: str = "4") -> Locator:
    live = open_live(page, server)
    live.get_by_label("Live / Hz").fill(rate_hz)
    press_for_light(live.get_by_role("button", name="Live", exact=True))
    expect(page.get_by_role("status", name="rig state")).to_have_text("LIVE")
    return live


def caption(live: Locator, view: str = "view1") -> Locator:
    return live.get_by_role("status", name=f"{view} newest shot")


def tile_of(live: Locator, view: str = "view1") -> Locator:
    return live.get_by_role("img", name=f"{view} live view")


def brightness(canvas: Locator) -> float:
    """Mean of what a canvas shows, 0 to 255."""
    mean = canvas.evaluate(
        "c => { const copy = new OffscreenCanvas(c.width, c.height).getContext('2d', { willReadFrequently: true });"
        " copy.drawImage(c, 0, 0); const d = copy.getImageData(0, 0, c.width, c.height).data;"
        " let s = 0; for (let i = 0; i < d.length; i += 4) s += d[i]; return 4 * s / d.length; }"
    )
    return float(mean)


def test_an_empty_page_says_what_to_do_first(page: Page, server: Serving) -> None:
    live = open_live(page, server)
    expect(live.get_by_text("No picture yet. Live shows the cameras and records nothing")).to_have_count(len(VIEWS))
    page.get_by_role("button", name="Set to half range").click()
    expect(page.get_by_role("status", name="light assistant")).to_contain_text("show the rig live with pulsed light")
    picture(page, "live-empty")


def test_rate_and_focus_of_a_tile_are_those_of_its_run_and_begin_anew_with_it(page: Page, server: Serving) -> None:
    live = open_live(page, server)
    expect(page.get_by_role("status", name="rig state")).to_have_text("READY")
    plan = plan_of(kind="background", shots=4, rate_hz=2.0, pulse={"current_a": dict.fromkeys(VIEWS, 5)})
    server.run_to_its_end(plan)
    expect(caption(live)).to_have_text(re.compile("^shot 3 "))
    threading.Event().wait(5.0)  # with that gap in it, the rate would be below 1 Hz
    server.run_to_its_end(plan)
    expect(caption(live)).to_have_text(re.compile(r"^shot 3 · [0-2]\.\d s old .* [12]\.\d Hz$"))
    trend = live.get_by_role("img", name="view1 focus trend").locator("path")
    expect(trend).to_have_attribute("d", re.compile("^M[^L]*(L[^L]*){1,3}$"))  # of four shots at most


def test_a_tile_tells_light_saturation_focus_and_rate(page: Page, server: Serving) -> None:
    live = show_live(page, server)
    figures = live.get_by_role("group", name="view1 figures")
    expect(caption(live)).to_have_text(re.compile(r"^shot \d+ · \d+\.\d s old · A \d+ % · B \d+ % · \d+\.\d Hz$"))
    expect(figures).to_contain_text(re.compile(r"light \d+ % of range, half is the aim"))
    expect(figures).to_contain_text("saturated 0.00 %")
    expect(figures).to_contain_text(re.compile(r"focus \d+\.\d %/px \(best \d+\.\d\)"))
    expect(figures.get_by_role("img", name="view1 histogram")).to_be_visible()


def test_a_picture_from_before_the_page_was_opened_is_as_old_as_it_is(page: Page, server: Serving) -> None:
    server.free_control()
    server.run_to_its_end(plan_of(kind="background", shots=1, pulse={"current_a": dict.fromkeys(VIEWS, 5)}))
    threading.Event().wait(3.0)
    live = open_live(page, server)
    expect(caption(live)).to_have_text(re.compile(r"^shot 0 · \d+\.\d s old"))
    assert live.locator(".lamp.ok").count() == 0
    expect(tile_of(live)).to_have_class(re.compile("old"))


def test_a_dark_frame_looks_dark_until_the_operator_stretches_it(page: Page, server: Serving) -> None:
    live = show_live(page, server)
    expect(caption(live)).to_have_text(re.compile("A [1-9]"))
    lit = brightness(tile_of(live))
    live.get_by_role("button", name="view1 stretched grey scale").click()
    eventually(lambda: brightness(tile_of(live)) > lit + 15, "the stretched picture is brighter")
    live.get_by_role("button", name="view1 stretched grey scale").click()
    live.get_by_role("switch", name="Pulsed light").click()
    live.get_by_role("button", name="Apply").click()
    expect(caption(live)).to_have_text(re.compile("A 2 % · B 2 %"))
    eventually(lambda: brightness(tile_of(live)) < 8, "the dark looks dark")
    expect(live.get_by_role("group", name="view1 figures")).to_contain_text("focus: no light")


def test_a_tile_shows_the_other_exposure_and_a_hidden_one_costs_nothing(page: Page, server: Serving) -> None:
    wishes = wishes_of(page)
    live = show_live(page, server)
    expect(caption(live)).to_have_text(re.compile("^shot"))
    live.get_by_role("button", name="view1 exposure A").click()
    expect(live.get_by_role("button", name="view1 exposure A")).to_have_attribute("aria-pressed", "true")
    eventually(lambda: '"view1":{"exposure":"a","scale":"full"}' in wishes[-1], "exposure A is asked for")
    live.get_by_role("button", name="view2 hidden").click()
    eventually(lambda: "view2" not in wishes[-1], "nobody asks for view2")
    expect(caption(live, "view2")).to_have_text("hidden")
    feed = server.app.state.context.live
    eventually(lambda: {view for view, _ in feed._pictures} == set(VIEWS) - {"view2"}, "nothing is made of view2")
    page.evaluate("Object.defineProperty(document, 'hidden', { value: true, configurable: true })")
    page.evaluate("document.dispatchEvent(new Event('visibilitychange'))")
    eventually(lambda: wishes[-1] == "{}", "a page in the background asks for nothing")
    page.evaluate("delete document.hidden; document.dispatchEvent(new Event('visibilitychange'))")
    eventually(lambda: '"view3"' in wishes[-1], "it asks again when it is seen")


def test_the_loupe_shows_pixels_one_to_one_and_the_cross_hair_the_middle(page: Page, server: Serving) -> None:
    live = show_live(page, server, "2")
    expect(caption(live)).to_have_text(re.compile("^shot"))
    live.get_by_role("button", name="Cross-hair").click()
    expect(live.get_by_role("img", name="view1 cross-hair")).to_be_visible()
    live.get_by_role("button", name="Loupe 1:1").click()
    tile = tile_of(live)
    tile.hover(position={"x": 100, "y": 90})
    loupe = live.get_by_role("img", name="view1 loupe")
    expect(loupe).to_be_visible()
    eventually(lambda: brightness(loupe) > 20, "the loupe shows what is at the mouse")
    point = live.locator(".live-point")
    expect(point).to_have_text(re.compile(r"^view1: column \d+, row \d+ px$"))
    before = point.inner_text()
    tile.focus()
    page.keyboard.press("ArrowRight")
    expect(point).not_to_have_text(before)
    picture(page, "live-loupe")


def test_what_the_bench_measures_in_a_browser_is_there_to_be_measured(browser: Browser, server: Serving) -> None:
    url = str(server.http.base_url)
    assert 0 < (first_page(browser, url, 1).value or 0) < 60
    assert 1 <= (drag(browser, url).value or 0) <= 10


def test_the_slider_of_a_current_asks_once_and_the_form_agrees(page: Page, server: Serving) -> None:
    open_live(page, server)
    thumb = page.get_by_label("LED view1 current").locator(".q-slider__track-container")
    thumb.hover()  # waits until the page has come to rest: a slider that moves away is not dragged
    box = thumb.bounding_box()
    assert box is not None
    page.evaluate(
        "() => { const emit = window.socket.emit; window.sent = [];"
        " window.socket.emit = function (...all) { window.sent.push(all[0]); return emit.apply(this, all); }; }"
    )
    page.mouse.move(box["x"] + 5, box["y"] + box["height"] / 2)
    page.mouse.down()
    for step in range(40):
        page.mouse.move(box["x"] + 5 + step * box["width"] / 50, box["y"] + box["height"] / 2)
        threading.Event().wait(0.02)
    page.mouse.up()
    number = page.get_by_label("LED view1 / A")
    expect(number).to_have_value(re.compile(r"^9\.\d$"))
    sent = page.evaluate("window.sent")
    assert sent.count("event") == 1
    value = number.input_value()
    go_to(page, "Run")
    expect(page.get_by_label("LED view1 / A")).to_have_value(value)


def test_the_assistant_sets_currents_to_half_range_and_says_what_it_did(page: Page, server: Serving) -> None:
    live = show_live(page, server)
    expect(caption(live)).to_have_text(re.compile("^shot"))
    page.get_by_role("button", name="Set to half range").click()
    advice = page.get_by_role("status", name="light assistant")
    expect(advice).to_contain_text(re.compile(r"By shot \d+, 0 s old:"))
    expect(advice).to_contain_text(re.compile(r"view1: 7\d % at [\d.]+ A: set to 6[\d.]* A"))
    expect(advice).to_contain_text(re.compile(r"view3: 3\d % at 10 A: set to 12 A, its limit, about 3\d %; for more"))
    expect(advice).to_contain_text("saturated: halved, look again")
    expect(page.get_by_label("LED view4 / A")).to_have_value("5")
    eventually(lambda: shown_current_a(server, "view1") < 7, "it is shown")
    expect(caption(live)).to_have_text(re.compile("A (49|50|51) %"))
    picture(page, "live-assistant")
    page.get_by_role("button", name="Set to half range").click()
    expect(advice).to_contain_text(re.compile(r"view1: \d+ % at 6[\d.]* A: left as it is, half of the range"))
    expect(caption(live, "view4")).to_have_text(re.compile("A (49|50|51) %"))
    page.set_viewport_size({"width": 1280, "height": 1000})
    picture(page, "desk-live")


def test_the_live_volume_says_what_it_lacks_and_follows_every_shot(page: Page, server: Serving) -> None:
    live = show_live(page, server, "4")
    volume = page.get_by_role("region", name="Live volume")
    problem = volume.get_by_role("note", name="why there is no newer volume")
    volume.get_by_role("switch", name="live slices").click()
    expect(problem).to_contain_text("there is no calibration")
    expect(problem).to_contain_text("on the page Calibrate")
    picture(page, "live-volume-empty")
    save_droplet_calibration(server.services.data_dir / "calibrations" / "paper.json")
    server.free_control()  # the page holds it
    assert server.http.put("/api/calibrations/current", json={"id": "paper"}).is_success
    told = volume.get_by_role("status", name="live volume")
    expect(told).to_have_text(
        re.compile(r"^shot \d+ · \d+\.\d s old · MLOS at half resolution · calibration paper · took \d\.\d\d s")
    )
    expect(volume.get_by_role("img", name="live slice z")).to_be_visible()
    made = server.app.state.context.live_volume
    first = made.view.number
    eventually(lambda: made.view.number > first + 1, "the next ones follow")
    volume.get_by_role("switch", name="live iso-surface").click()
    expect(volume.get_by_role("img", name="live iso-surface").locator("canvas")).to_be_visible()
    volume.scroll_into_view_if_needed()
    picture(page, "live-volume")
    volume.get_by_role("switch", name="live iso-surface").click()
    volume.get_by_role("switch", name="live slices").click()
    expect(volume.get_by_role("img", name="live slice z")).to_have_count(0)
    page.wait_for_timeout(300)
    last = made.view.number
    page.wait_for_timeout(1000)
    assert made.view.number == last, "nobody looks"
    live.get_by_role("button", name="End live").click()


def test_the_timing_follows_the_form_and_says_why_it_is_impossible(page: Page, server: Serving) -> None:
    open_live(page, server)
    timing = page.get_by_role("region", name="Timing")
    expect(timing).to_contain_text("separation 6400 ns, pulses 1000 ns")
    page.get_by_label("Separation / ns").fill("12000")
    expect(timing).to_contain_text("separation 12 µs")
    page.get_by_label("Separation / ns").fill("2500")
    problem = timing.get_by_role("alert", name="timing problem")
    expect(problem).to_contain_text("is below 3400 ns")
    expect(problem).to_contain_text("change rate, width or separation")
    page.get_by_label("Separation / ns").fill("6400")
    expect(problem).to_be_hidden()


def test_a_refusal_of_the_live_view_has_its_remedy(page: Page, server: Serving) -> None:
    live = open_live(page, server)
    laboratory(server).open_door()
    live.get_by_role("button", name="Live", exact=True).click()
    refusal = live.get_by_role("alert", name="live refusal")
    expect(refusal).to_contain_text("(close the door)")
    laboratory(server).close_door()
    expect(refusal).to_have_text("")


def test_a_card_per_device_says_who_how_and_what_to_do(page: Page, server: Serving) -> None:
    page.goto(f"{server.http.base_url}/rig")
    camera = page.get_by_role("region", name="view1", exact=True)
    expect(camera).to_contain_text("tomoshadow memory, view1, firmware 1")
    expect(camera).to_contain_text("400 x 300 px, 8 bit")
    expect(page.get_by_role("region", name="pulse generator")).to_contain_text("at most 12 A, nominal 10 A, channel 1")
    expect(page.get_by_role("region", name="interlock")).to_contain_text("closed")
    expect(page.get_by_role("region", name="work in the background")).to_contain_text("all of it goes on")
    expect(page.get_by_role("status", name="link budget")).to_contain_text(
        "At most 47.6 pass: the limit is the cameras"
    )
    camera.evaluate("card => card.dataset.mark = 'the same'")
    laboratory(server).cameras["view1"].is_lost = True
    laboratory(server).open_door()
    expect(camera).to_contain_text("does not answer")
    expect(camera).to_contain_text("Do: check power and cable of the camera")
    expect(page.get_by_role("region", name="interlock")).to_contain_text("Do: close the door")
    expect(camera).to_contain_text(re.compile(r"last answer \d+ s ago"))
    picture(page, "rig-trouble")
    laboratory(server).cameras["view1"].is_lost = False
    camera.get_by_role("button", name="Reconnect").click()
    expect(camera).to_contain_text("tomoshadow memory, view1, firmware 1")
    expect(camera).to_have_attribute("data-mark", "the same")


def test_a_page_at_rest_changes_nothing(page: Page, server: Serving) -> None:
    """Cards that are built anew four times a second cost browsers and readers; only what changes may change."""
    page.goto(f"{server.http.base_url}/rig")
    expect(page.get_by_role("region", name="view1", exact=True)).to_contain_text("firmware 1")
    page.wait_for_timeout(500)
    page.evaluate(
        "() => { window.changes = 0; new MutationObserver(all => { window.changes += all.length; }).observe("
        "document.querySelector('.desk-page'), { subtree: true, childList: true, characterData: true }); }"
    )
    page.wait_for_timeout(2000)
    assert page.evaluate("window.changes") == 0


def test_the_doctor_looks_when_asked_and_between_runs_only(page: Page, server: Serving) -> None:
    page.goto(f"{server.http.base_url}/rig")
    doctor = page.get_by_role("region", name="Doctor")
    doctor.get_by_role("button", name="Examine").click()
    expect(doctor.get_by_role("status", name="doctor")).to_have_text(re.compile(r"^\d+ things looked at: .*at \d"))
    expect(doctor).to_contain_text("network of view1")
    picture(page, "rig-doctor")
    server.http.put("/api/rig/live", json={"rate_hz": 2})
    expect(doctor.get_by_role("button", name="Examine")).to_be_disabled()
    expect(page.get_by_role("region", name="view1", exact=True).get_by_role("button")).to_be_disabled()


def test_the_rig_page_fits_every_width_dark_and_light(page: Page, server: Serving) -> None:
    page.goto(f"{server.http.base_url}/rig")
    expect(page.get_by_role("region", name="view1", exact=True)).to_contain_text("firmware 1")
    expect_to_fit(page, "rig")


def test_the_live_page_fits_every_width_dark_and_light(page: Page, server: Serving) -> None:
    live = show_live(page, server)
    expect(caption(live)).to_have_text(re.compile("Hz$"))
    expect_to_fit(page, "live")
    open_drawer(page)
    expect_to_fit(page, "live-drawer")


def expect_to_fit(page: Page, name: str) -> None:
    for width in (800, 1280, 1920):
        page.set_viewport_size({"width": width, "height": 1000})
        page.wait_for_function(f"innerWidth === {width}")
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth"), "the page is wider than the window"
        expect_nothing_cut(page)
        expect_none_over_another(page)
        for shade in ("light", "dark"):
            picture(page, f"{name}-{width}-{shade}")
            page.get_by_role("button", name="dark or light").click()


def shown_current_a(server: Serving, view: str) -> float:
    """Current of a view that the live view is shown by."""
    plan = server.services.acquisition.status().live
    return plan.pulse.current_a[view] if plan and plan.pulse else math.inf


def expect_nothing_cut(page: Page) -> None:
    words = page.locator(".q-field__label, .live-caption, .live-figures *, .live-choice button, .device-card *")
    cut = words.evaluate_all(
        "found => found.filter(one => one.scrollWidth > one.clientWidth + 1 && one.clientWidth"
        " && getComputedStyle(one).display !== 'inline').map(one => one.className + ': ' + one.textContent)"
    )
    assert cut == []


def expect_none_over_another(page: Page) -> None:
    """Name and buttons of a tile lie beside or below each other."""
    covered = page.locator(".live-head").evaluate_all("""heads => heads.filter(head => {
        const [name, choice] = [...head.children].map(one => one.getBoundingClientRect());
        return choice && name.right > choice.left && name.bottom > choice.top;
    }).map(head => head.textContent)""")
    assert covered == []


def wishes_of(page: Page) -> list[str]:
    """What the page says to the live socket, from now on."""
    wishes = ["nothing yet"]

    def listen(socket: WebSocket) -> None:
        if socket.url.endswith("/api/live"):
            socket.on("framesent", lambda payload: wishes.append(str(payload)))

    page.on("websocket", listen)
    return wishes


def test_a_spray_is_recorded_and_seen_on_the_page_run(page: Page, server: Serving) -> None:
    save_droplet_calibration(server.services.data_dir / "calibrations" / "spray.json")
    server.http.put("/api/calibrations/current", json={"id": "spray"}).raise_for_status()
    for kind in ("dark", "background"):
        server.run_to_its_end(plan_of(kind=kind, name=kind, shots=1, pulse={"current_a": dict.fromkeys(VIEWS, 6)}))
    page.set_viewport_size({"width": 1280, "height": 900})
    page.goto(f"{server.http.base_url}/run")
    for label, text in (("Shots", "400"), ("Rate / Hz", "4"), *((f"LED {view} / A", "6") for view in VIEWS)):
        page.get_by_label(label, exact=True).fill(text)
    page.get_by_label("Fluid").fill("water")
    press_for_light(page.get_by_role("button", name="Start run"))
    expect(page.get_by_role("list", name="shots").get_by_role("listitem", name="shot 3: valid")).to_be_visible()
    expect(page.get_by_role("group", name="newest shots").get_by_role("img").nth(1)).to_be_visible()
    picture(page, "desk-run")
    page.set_viewport_size({"width": 1600, "height": 950})
    page.emulate_media(color_scheme="dark")
    picture(page, "page")
    page.get_by_role("button", name="Stop").click()
    expect(page.get_by_label("run outcome")).to_have_text("stopped")
