"""Headless Chromium for tests that look at the page as an operator does."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page

from server.cli.benchmarks.chromium import NoBrowser, chromium
from tests.support.desk import opened_tab, serving_desk
from tests.support.serving import Serving


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    try:
        with chromium() as browser:
            yield browser
    except NoBrowser as error:
        pytest.skip(str(error))


@pytest.fixture
def server(tmp_path: Path) -> Iterator[Serving]:
    """A server for every test, in a tenth of a second: none finds a form, runs or alarms that another one left."""
    with serving_desk(tmp_path / "runs") as server:
        yield server


@pytest.fixture
def page(browser: Browser, server: Serving) -> Iterator[Page]:
    """A tab that fails the test if the page complains; it is closed before its server."""
    with opened_tab(browser) as page:
        yield page
