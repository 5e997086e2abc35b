"""What an operator's browser sees of a server: how soon a page is usable, what a drag costs, when ABORT is answered."""

import os
import re
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from statistics import median
from typing import TYPE_CHECKING, Any

from processing.benchmarks import targets
from processing.benchmarks.targets import Measured, Target
from server.cli.benchmarks.bench_rig import NoRig
from server.cli.benchmarks.busy_server import BUSY_S
from server.cli.benchmarks.chromium import NoBrowser, chromium
from server.cli.benchmarks.served import Server

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Locator, Page

TIMES = 5
_SIZE: Any = {"width": 1600, "height": 950}
_LIMIT_MS = 30_000
_BUSY_BEFORE_S = 0.3
_SLIDER = re.compile("^LED .* current$")
_DRAG_STEPS, _DRAG_STEP_MS = 40, 20
_USABLE = (
    "() => ['rig state', 'connection'].every(name => document.querySelector(`[aria-label='${name}']`)?.innerText)"
    " && [...document.querySelectorAll('button')].some(one => one.textContent.includes('Start run')"
    " && !one.disabled && !one.closest('[inert]'))"
)
_ABORT = """async limit => {
  const began = performance.now();
  document.querySelector('.abort-button').click();
  while (!/^light off confirmed/.test(document.querySelector('.abort-answer')?.textContent ?? '')) {
    if (performance.now() - began > limit) throw new Error('ABORT was not answered');
    await new Promise(done => setTimeout(done, 1));
  }
  return performance.now() - began;
}"""


def browsed(server: Server, live: dict[str, Any], times: int) -> Iterator[Measured]:
    """Three lines by a browser; where there is none they say so.

    Parameters
    ----------
    server : Server
        Of ``server.cli.benchmarks.busy_server``; nothing runs.
    live : dict
        Settings of a live view, whose light is to be ended.
    times : int
        How often a page is opened, and ABORT pressed.
    """
    by_target: dict[Target, Callable[[Browser], Measured]] = {
        targets.FIRST_PAGE: lambda browser: first_page(browser, server.page_url, times),
        targets.ABORT: lambda browser: _abort(browser, server, live, times),
        targets.DRAG: lambda browser: drag(browser, server.page_url),
    }
    for target, measure in by_target.items():
        try:
            with chromium() as browser:
                yield measure(browser)
        except NoBrowser as error:
            yield Measured(target, None, how=str(error))


@contextmanager
def _tab(browser: "Browser", url: str) -> Iterator["Page"]:
    """A tab of a browser that has never been here before."""
    context = browser.new_context(viewport=_SIZE)
    page = context.new_page()
    page.goto(url)
    page.wait_for_function(_USABLE, timeout=_LIMIT_MS)
    yield page
    context.close()


def first_page(browser: "Browser", url: str, times: int) -> Measured:
    """Until the state of the rig is told, the server heard, and *Start run* can be pressed."""
    waits_s = []
    for _ in range(times + 1):
        began_s = time.perf_counter()
        with _tab(browser, url):
            waits_s.append(time.perf_counter() - began_s)
    how = f"median of {times} in Chromium, nothing cached; the very first {waits_s[0]:.2g} s"
    return Measured(targets.FIRST_PAGE, median(waits_s[1:]), how=how)


def _abort(browser: "Browser", server: Server, live: dict[str, Any], times: int) -> Measured:
    """From the click until the page says that the light is confirmed off."""
    waits_ms = []
    for _ in range(times):
        with _tab(browser, server.page_url) as page:
            server.ask("rig/live", live, "PUT")
            os.kill(server.process.pid, signal.SIGUSR1)
            time.sleep(_BUSY_BEFORE_S)
            waits_ms.append(float(page.evaluate(_ABORT, _LIMIT_MS)))
    if max(waits_ms) > 1000 * (BUSY_S - _BUSY_BEFORE_S):
        raise NoRig(f"ABORT took {max(waits_ms):.0f} ms: it waited for the main loop")
    how = f"median of {times}, the longest {max(waits_ms):.0f} ms; from the click to what the page says"
    return Measured(targets.ABORT, median(waits_ms), how=how)


def drag(browser: "Browser", url: str) -> Measured:
    """Requests and messages of the page while the current of a LED is dragged, less the beats of its connection."""
    sent: list[str] = []
    with _tab(browser, url) as page:
        page.get_by_role("link", name="Live", exact=True).click()
        thumb = page.get_by_label(_SLIDER).locator(".q-slider__track-container").first
        thumb.wait_for(timeout=_LIMIT_MS)
        page.evaluate(
            "() => { const emit = window.socket.emit; window.sent = 0;"
            " window.socket.emit = function (...all) { window.sent += 1; return emit.apply(this, all); }; }"
        )
        page.on("request", lambda request: sent.append(request.url))
        _drag_slowly(page, thumb)
        count = len(sent) + int(page.evaluate("window.sent"))
    return Measured(targets.DRAG, count, how=f"{_DRAG_STEPS} moves of the mouse")


def _drag_slowly(page: "Page", slider: "Locator") -> None:
    box = slider.bounding_box()
    if box is None:
        raise NoRig("the page has no slider")
    across, y = box["width"] / 2 / _DRAG_STEPS, box["y"] + box["height"] / 2
    page.mouse.move(box["x"] + 5, y)
    page.mouse.down()
    for step in range(_DRAG_STEPS):
        page.mouse.move(box["x"] + 5 + step * across, y)
        page.wait_for_timeout(_DRAG_STEP_MS)
    page.mouse.up()
    page.wait_for_timeout(_LIMIT_MS / 30)
