"""Every page for everybody: nothing serious or critical of what axe-core looks for, dark and light; in Chromium."""

from typing import Literal

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Page

from server.web.ui.rail import STOPS
from tests.support.desk import PULSE, choose_calibration
from tests.support.operator import go_to, open_drawer
from tests.support.serving import Serving, plan_of

pytestmark = pytest.mark.timeout(900)

SCHEMES: tuple[Literal["dark", "light"], ...] = ("dark", "light")
OF_QUASAR = (".q-loading-bar",)
"""Elements of Quasar itself that nothing of ours can mend: the line at the top while something loads has no name."""


def findings(page: Page) -> list[str]:
    """Serious and critical ones, each with its element."""
    found = Axe().run(page, {"exclude": [[element] for element in OF_QUASAR]}).response["violations"]
    return [
        f"{one['id']}: {node['html'][:160]} {node['any'][0]['message'] if node['any'] else ''}"
        for one in found
        if one["impact"] in ("serious", "critical")
        for node in one["nodes"]
    ]


def test_nothing_serious_is_found_on_any_page(page: Page, server: Serving) -> None:
    choose_calibration(server)
    server.run_to_its_end(plan_of(shots=2, pulse=PULSE))
    page.goto(str(server.http.base_url))
    open_drawer(page)
    for stop in STOPS:
        go_to(page, stop.title)
        for scheme in SCHEMES:
            page.emulate_media(color_scheme=scheme)
            page.wait_for_timeout(500)  # lists are there, and nothing is blended over any more
            assert (stop.title, scheme, findings(page)) == (stop.title, scheme, [])
