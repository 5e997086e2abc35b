"""What a viewer sees and may do; headless Chromium."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, BrowserContext, Page, expect

from tests.support.cut_link import cut_link
from tests.support.desk import choose_calibration, laboratory, serving_desk
from tests.support.operator import VIEWS, go_to
from tests.support.serving import Serving, plan_of

OPERATOR = {"Authorization": "Bearer operate", "Tomoshadow-Operator": "ann@lab"}
pytestmark = pytest.mark.timeout(900)


@pytest.fixture
def server(tmp_path: Path) -> Iterator[Serving]:
    with serving_desk(tmp_path / "runs", token="operate", viewer_token="look") as server:
        yield server


def sign_in(page: Page, server: Serving, name: str, token: str) -> None:
    page.goto(f"{server.http.base_url}/run")
    page.get_by_label("Your name").fill(name)
    page.get_by_label("Token of an operator or a viewer").fill(token)
    page.get_by_role("button", name="Sign in").click()
    expect(page.get_by_role("status", name="connection", exact=True)).to_have_text("connected")


def test_a_viewer_looks_and_aborts_and_signs_out(page: Page, server: Serving) -> None:
    sign_in(page, server, "eve", "look")
    expect(page.get_by_role("button", name="control: viewer")).to_be_visible()
    expect(page.get_by_role("button", name="Start run")).to_be_disabled()
    page.get_by_role("button", name="ABORT").click()
    expect(page.get_by_role("alert", name="abort answer")).to_have_text(re.compile("^light off confirmed"))
    page.get_by_role("button", name="control: viewer").click()
    page.get_by_role("button", name="Sign out").click()
    expect(page.get_by_role("button", name="Sign in")).to_be_visible()


def test_a_viewer_sees_the_light_of_the_next_run_and_does_not_change_it(page: Page, server: Serving) -> None:
    sign_in(page, server, "eve", "look")
    expect(page.get_by_role("combobox", name="Template")).to_have_count(0)  # a locked one is none
    page.goto(f"{server.http.base_url}/live")
    for name in ("Pulse width / ns", "Separation / ns", "LED view1 / A"):
        expect(page.get_by_label(name)).to_be_disabled()
    expect(page.get_by_role("button", name="Set to half range")).to_be_disabled()


LOOKING = re.compile(
    r"ABORT|why this state|jobs and events|dark or light|control: viewer|view\d .*|Cross-hair|Loupe 1:1|Download|slices"
    r"|region|maxima|A|B|both|see the whole volume|Show|(Collapse|Expand) .*|(older|newer) runs"
)
ENABLED = re.compile(r'- \'?button "((?:[^"\\]|\\.)*)"(?!.*\[disabled\])')


def test_a_viewer_finds_every_button_locked_that_does_more_than_look_and_is_told_why(
    page: Page, server: Serving
) -> None:
    server.http.headers.update(OPERATOR)
    choose_calibration(server)
    pulse = {"current_a": dict.fromkeys(VIEWS, 5)}
    run_id, _ = server.run_to_its_end(plan_of(kind="calibration", shots=1, pulse=pulse))
    run_id, _ = server.run_to_its_end(plan_of(shots=1, pulse=pulse))
    server.free_control()
    sign_in(page, server, "eve", "look")
    laboratory(server).generator.trip("overcurrent")
    for path, there in (
        ("rig", "Examine"),
        ("live", "Shoot one"),
        ("calibrate", "Calibrate"),
        ("run", "Acknowledge fault"),
        (f"results/{run_id}", "Measure"),
        (f"runs/{run_id}", "Delete..."),
    ):
        page.goto(f"{server.http.base_url}/{path}")
        expect(page.get_by_role("button", name=there, exact=True).first).to_be_disabled()
        expect(page.get_by_role("button", name=re.compile("^Acknowledge pulse generator"))).to_be_disabled()
        expect(page.get_by_role("button", name="why this state")).to_be_enabled()
        enabled = ENABLED.findall(page.locator("body").aria_snapshot())
        assert "ABORT" in enabled
        assert [name for name in enabled if not LOOKING.fullmatch(name)] == [], path
        mute = page.locator("button:disabled:not([title], [title] *)")
        assert mute.evaluate_all("found => found.map(one => one.innerText)") == [], path


def test_a_session_that_is_ended_elsewhere_closes_its_page(page: Page, server: Serving) -> None:
    sign_in(page, server, "ann", "operate")
    expect(page.get_by_role("button", name="control: free")).to_be_visible()
    expect(page.get_by_role("button", name="Start run")).to_be_enabled()
    page.context.request.post(f"{server.http.base_url}/sign-out", max_redirects=0)
    expect(page.get_by_role("button", name="Sign in")).to_be_visible()


def test_a_session_that_the_server_forgot_while_it_was_away_leads_to_signing_in(
    browser: Browser, server: Serving
) -> None:
    with cut_link(server.port) as link:
        context = browser.new_context()
        page = context.new_page()
        page.goto(f"http://127.0.0.1:{link.port}/sign-in")
        page.get_by_label("Token of an operator or a viewer").fill("look")
        page.get_by_role("button", name="Sign in").click()
        expect(page.get_by_role("status", name="connection", exact=True)).to_have_text("connected")
        link.cut()
        expect(page.get_by_role("status", name="rig state").locator(".rig-unknown")).to_be_visible()
        page.wait_for_function("!window.socket.active")
        sessions = server.app.state.door.sessions
        sessions.end(cookie_of_tab(context))
        link.mend()
        expect(page.get_by_role("button", name="Sign in")).to_be_visible()
        context.close()


def cookie_of_tab(context: BrowserContext) -> str:
    (cookie,) = (one["value"] for one in context.cookies() if one["name"].startswith("tomoshadow-"))
    return cookie


def test_a_viewer_changes_neither_the_form_nor_the_live_view(page: Page, server: Serving) -> None:
    (server.services.data_dir / "templates").mkdir(exist_ok=True)
    (server.services.data_dir / "templates" / "bright.json").write_text('{"shots": 77}')
    sign_in(page, server, "eve", "look")
    expect(page.locator(".q-field--disabled").filter(has_text="Template")).to_be_visible()
    expect(page.get_by_role("button", name="keep as a template")).to_be_disabled()
    go_to(page, "Live")
    plan = {"rate_hz": 2.0, "pulse": {"current_a": dict.fromkeys(VIEWS, 5)}}
    server.http.put("/api/rig/live", json=plan, headers=OPERATOR).raise_for_status()
    expect(page.get_by_role("status", name="rig state")).to_have_text("LIVE")
    for name in ("Apply", "End live", "Shoot one", "Set to half range"):
        expect(page.get_by_role("button", name=name)).to_be_disabled()
    for label in ("Pulse width / ns", "LED view1 / A"):
        expect(page.get_by_label(label)).to_be_disabled()
