"""What tests of the desk in a browser share: the far ends of its rig, runs that go on, pictures."""

import os
from pathlib import Path
from typing import Any

from playwright.sync_api import Page

from tests.support.operator import VIEWS
from tests.support.serving import Serving, plan_of

PICTURES = os.environ.get("TOMOSHADOW_PICTURES")
"""Folder for pictures of pages; without it none are taken."""
PULSE = {"current_a": dict.fromkeys(VIEWS, 5)}


def laboratory(server: Serving) -> Any:
    """The far ends of its rig in memory."""
    return server.services.laboratory


def start(server: Serving, **changes: Any) -> None:
    """Begin a dark run that goes on."""
    plan = plan_of(pulse=PULSE, **{"kind": "dark", "shots": 1000, "rate_hz": 5.0, **changes})
    assert server.http.post("/api/runs", json=plan).status_code == 201


def picture(page: Page, name: str) -> None:
    """Take one, once nothing moves any more."""
    if PICTURES:
        page.wait_for_timeout(1000)
        page.screenshot(path=str(Path(PICTURES) / f"{name}.png"))
