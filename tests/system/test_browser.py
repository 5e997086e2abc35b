"""The operator's page in a real browser: headless Chromium, a real server, every device honest."""

import os
from collections.abc import Iterator

import pytest
from playwright.sync_api import Page

from server.app import create_app
from tests.server.serving import Serving, serving
from tests.system.operator import VIEWS, drive_the_page

PICTURES = os.environ.get("TOMOSHADOW_PICTURES")


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Serving]:
    data_dir = tmp_path_factory.mktemp("browser") / "runs"
    with serving(data_dir, build=create_app, views=VIEWS) as server:
        (data_dir / "calibrations" / "paper.json").write_text('{"id": "paper"}')
        server.http.put("/api/calibrations/current", json={"id": "paper"})
        yield server


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
