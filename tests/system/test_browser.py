"""The operator's page in a real browser: headless Chromium, a real server, every device honest.

``drive_the_page`` needs only an address: it drives the simulated bench as well as the rig in memory.
"""

import os
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, ConsoleMessage, Page, expect, sync_playwright

from server.app import create_app
from tests.server.serving import Serving, serving

CHROMIUM = Path("/usr/bin/chromium")
FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
VIEWS = ("view1", "view2", "view3", "view4")
PICTURES = os.environ.get("TOMOSHADOW_PICTURES")

pytestmark = pytest.mark.skipif(not CHROMIUM.exists(), reason=f"{CHROMIUM} is not installed")


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=str(CHROMIUM), args=list(FLAGS))
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Serving]:
    data_dir = tmp_path_factory.mktemp("browser") / "runs"
    with serving(data_dir, build=create_app, views=VIEWS) as server:
        (data_dir / "calibrations" / "paper.json").write_text('{"id": "paper"}')
        server.http.put("/api/calibrations/current", json={"id": "paper"})
        yield server


@pytest.fixture
def page(browser: Browser) -> Iterator[Page]:
    """A tab that fails the test if the page complains."""
    context = browser.new_context(viewport={"width": 1600, "height": 950})
    page, complaints = context.new_page(), list[str]()

    def listen(message: ConsoleMessage) -> None:
        if message.type == "error" or (message.type == "warning" and "GPU stall" not in message.text):
            complaints.append(message.text)

    page.on("console", listen)
    page.on("pageerror", lambda error: complaints.append(str(error)))
    yield page
    context.close()
    assert complaints == []


def drive_the_page(page: Page, base_url: str, views: tuple[str, ...], shots: int) -> None:
    """What an operator does: look, be refused, start a run, watch it end, see it, find its volume."""
    page.goto(base_url)
    for view in views:
        expect(page.get_by_role("img", name=f"{view} live view")).to_be_visible()
        expect(page.get_by_role("status", name=re.compile(f"^{view}: ok"))).to_be_visible()
    expect(page.get_by_role("status", name="acquisition state")).to_have_text("IDLE")
    _is_refused(page, shots)
    page.get_by_role("button", name="Start run").click()
    counts = page.get_by_role("status", name="run counts")
    expect(counts).to_have_text(f"{shots} / {shots} shots recorded, {shots} valid", timeout=60_000)
    expect(page.get_by_label("run outcome")).to_have_text("completed")
    expect(page.get_by_role("log")).to_contain_text("shot 0 recorded")
    for view in views:
        expect(page.get_by_role("status", name=f"{view} live")).to_be_attached()
    expect(page.get_by_role("region", name="Processing").get_by_text("done").first).to_be_visible(timeout=60_000)
    _look_at_the_volume(page)


def _is_refused(page: Page, shots: int) -> None:
    page.get_by_label("Shots", exact=True).fill("0")
    page.get_by_role("button", name="Start run").click()
    expect(page.get_by_text("greater than or equal to 1")).to_be_visible()
    page.get_by_label("Shots", exact=True).fill(str(shots))
    page.get_by_label("Rate / Hz").fill("99")
    expect(page.get_by_role("alert").filter(has_text="the limit of the cameras")).to_be_visible()
    page.get_by_label("Rate / Hz").fill("2")
    expect(page.get_by_role("alert").filter(has_text="the limit of the cameras")).to_have_count(0)


def _look_at_the_volume(page: Page) -> None:
    for axis in "xyz":
        image = page.get_by_role("img", name=f"slice {axis}").locator("img")
        expect(image).to_have_attribute("src", re.compile(rf"slices/{axis}/\d+\.png"))
    slider = page.get_by_role("slider", name="slice y")
    before = page.get_by_role("img", name="slice y").locator("img").get_attribute("src")
    slider.locator("[tabindex='0']").first.focus()
    for _ in range(5):
        page.keyboard.press("ArrowRight")
    expect(page.get_by_role("img", name="slice y").locator("img")).not_to_have_attribute("src", before or "")
    expect(page.get_by_role("img", name="iso-surface").locator("canvas")).to_be_visible()


def _take_picture(page: Page, name: str) -> None:
    if PICTURES:
        page.wait_for_timeout(1500)
        page.screenshot(path=f"{PICTURES}/{name}.png")


def test_an_operator_records_a_run_and_sees_its_volume(page: Page, server: Serving) -> None:
    drive_the_page(page, str(server.http.base_url), VIEWS, shots=5)
    _take_picture(page, "page-dark")
    page.get_by_role("button", name="dark or light").click()
    _take_picture(page, "page-light")
    page.set_viewport_size({"width": 480, "height": 950})
    _take_picture(page, "page-narrow")
