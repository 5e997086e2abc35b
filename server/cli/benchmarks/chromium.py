"""Chromium without a window, driven by Playwright: an operator's browser, for tests and for what ``bench`` measures."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from processing.errors import BadInput

if TYPE_CHECKING:
    from playwright.sync_api import Browser

CHROMIUM = Path("/usr/bin/chromium")
_FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)


class NoBrowser(BadInput):
    """There is no browser here; the text says what to install."""


@contextmanager
def chromium() -> Iterator["Browser"]:
    """A browser that ends with the block.

    Raises
    ------
    NoBrowser
        Chromium or Playwright is not installed.
    """
    if not CHROMIUM.exists():
        raise NoBrowser(f"{CHROMIUM} is not installed")
    try:
        from playwright.sync_api import sync_playwright
    except ImportError as error:
        raise NoBrowser("Playwright of PyPI is not installed") from error
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=str(CHROMIUM), args=list(_FLAGS))
        yield browser
        browser.close()
