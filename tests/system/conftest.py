"""Headless Chromium for tests that look at the page as an operator does."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, ConsoleMessage, Page

from server.cli.benchmarks.chromium import NoBrowser, chromium
from tests.support.desk import laboratory
from tests.support.serving import Serving


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    try:
        with chromium() as browser:
            yield browser
    except NoBrowser as error:
        pytest.skip(str(error))


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


@pytest.fixture
def at_rest(server: Serving) -> Iterator[None]:
    """Every test leaves a rig behind that nobody holds, on which nothing is wrong."""
    yield
    laboratory(server).close_door()
    server.http.post("/api/rig/abort")
    server.wait()
    server.http.post("/api/rig/acknowledge")
    server.free_control()
