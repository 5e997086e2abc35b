"""What tests of the desk in a browser share: the far ends of its rig, runs that go on, pictures."""

import json
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from nicegui import app as pages
from nicegui import background_tasks
from playwright.sync_api import Browser, ConsoleMessage, Page

from server.web.app import create_app
from tests.support.drifting_views import SIZE_PX
from tests.support.live_shots import spray_scene
from tests.support.operator import VIEWS
from tests.support.serving import Serving, plan_of, serving

PICTURES = os.environ.get("TOMOSHADOW_PICTURES")
"""Folder for pictures of pages; without it none are taken. Those of the manual are listed in CONTRIBUTING.md."""
_PICTURE_OF_A_RUN = re.compile(r"/api/runs/[^/]+/.*\.(jpg|png)")
PULSE = {"current_a": dict.fromkeys(VIEWS, 5)}


@contextmanager
def serving_desk(data_dir: Path, **options: Any) -> Iterator[Serving]:
    """Serve a rig in memory with its pages until the block ends.

    NiceGUI has one application per process: what an earlier server has put around it goes, and so do tasks that began
    while that one ended; NiceGUI would wait for them for ever, as their loop is over.
    """
    pages.middleware_stack = None
    pages.user_middleware.clear()
    for tasks in (background_tasks.running_tasks, background_tasks.lazy_tasks_running):
        tasks.clear()
    with serving(data_dir, views=VIEWS, **{"build": create_app, **options}) as server:
        yield server


@contextmanager
def opened_tab(browser: Browser) -> Iterator[Page]:
    """A tab of a person of its own; fails at its end if the page has complained."""
    context = browser.new_context(viewport={"width": 1600, "height": 950})
    page, complaints = context.new_page(), list[str]()

    def listen(message: ConsoleMessage) -> None:
        if "404" in message.text and _PICTURE_OF_A_RUN.search(message.location["url"]):
            return  # the run was deleted before its picture was drawn
        if message.type == "error" or (message.type == "warning" and "GPU stall" not in message.text):
            complaints.append(f"{message.text}: {message.location['url']}")

    page.on("console", listen)
    page.on("pageerror", lambda error: complaints.append(str(error)))
    yield page
    context.close()
    assert not complaints, complaints


_WITHOUT_KEYS = """() => {
    const keys = "a[href], button, input, textarea, [tabindex]:not([tabindex='-1'])";
    const hears = one => one.closest(keys + ", label, .q-field") || one.querySelector(keys);
    const isClicked = one => getComputedStyle(one).cursor === "pointer" && one.getClientRects().length > 0;
    const found = [...document.querySelectorAll("body *")].filter(one => isClicked(one) && !hears(one));
    return found.map(one => `${one.tagName} ${one.className} ${one.innerText}`);
}"""


def without_keys(page: Page) -> list[str]:
    """What can be clicked, and no key reaches.

    A slice is clicked too, and has a slider instead; an iso-surface is turned by keys in test_desk_results.py.
    """
    return list(page.evaluate(_WITHOUT_KEYS))


def choose_calibration(server: Serving, name: str = "paper") -> None:
    """Make a file that is none the current calibration; nobody holds control afterwards."""
    (server.services.data_dir / "calibrations" / f"{name}.json").write_text(json.dumps({"id": name}))
    server.http.put("/api/calibrations/current", json={"id": name}).raise_for_status()
    server.free_control()


def laboratory(server: Serving) -> Any:
    """The far ends of its rig in memory."""
    return server.services.laboratory


def show_spray(server: Serving) -> None:
    """A spray is before its cameras, as droplets are seen."""
    for camera in laboratory(server).cameras.values():
        camera.image_shape, camera._scene = SIZE_PX[::-1], spray_scene


def start(server: Serving, **changes: Any) -> None:
    """Begin a dark run that goes on."""
    plan = plan_of(pulse=PULSE, **{"kind": "dark", "shots": 1000, "rate_hz": 5.0, **changes})
    assert server.http.post("/api/runs", json=plan).status_code == 201


def picture(page: Page, name: str) -> None:
    """Take one, once nothing moves any more."""
    if PICTURES:
        page.wait_for_timeout(1000)
        page.screenshot(path=str(Path(PICTURES) / f"{name}.png"))
