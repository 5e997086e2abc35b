"""What an operator does on the page; needs only an address, and so drives any rig."""

import re
from contextlib import suppress

from playwright.sync_api import Locator, Page, expect

from daq.counted import counted

expect.set_options(timeout=120_000)
PROCESSED_MS = 180_000
"""Processing is last in line for processors: on a busy machine it takes its time."""

VIEWS = ("view1", "view2", "view3", "view4")


def go_to(page: Page, title: str) -> None:
    """Follow the rail to a page."""
    page.get_by_role("navigation", name="pages").get_by_role("link", name=title, exact=True).click()
    expect(page.get_by_role("navigation", name="pages").locator("[aria-current=page]")).to_have_text(re.compile(title))


def open_drawer(page: Page) -> None:
    """Look at jobs and events."""
    page.get_by_role("button", name="jobs and events").click()
    expect(page.get_by_role("log")).to_be_visible()


def press_for_light(button: Locator) -> None:
    """Press what makes light, as somebody who holds no control yet; on a busy machine a press may be too late.

    Then it is refused, and the page says so: press again.
    """
    mine = button.page.get_by_role("button", name="control: you")
    late = button.page.get_by_role("alert").filter(has_text="nothing was started")
    button.click()
    with suppress(AssertionError):  # nothing came of it: the page moved under the hand
        expect(mine.or_(late).first).to_be_visible(timeout=10_000)
    for _ in range(5):
        if mine.is_visible():
            return
        button.click()
        with suppress(AssertionError):
            expect(mine).to_be_visible(timeout=10_000)
    expect(mine).to_be_visible()


def drive_the_page(page: Page, base_url: str, views: tuple[str, ...], shots: int) -> None:
    """What an operator does: look, be refused, start a run, watch it end, see it, find its volume."""
    page.goto(base_url)
    open_drawer(page)
    for view in views:
        expect(page.get_by_role("img", name=f"{view} live view")).to_be_visible()
        expect(page.get_by_role("status", name=re.compile(f"^{view}: ok"))).to_be_visible()
    expect(page.get_by_role("status", name="rig state")).to_have_text("READY")
    _is_refused(page, shots)
    press_for_light(page.get_by_role("button", name="Start run"))
    counts = page.get_by_role("status", name="run counts")
    expect(counts).to_have_text(f"{shots} / {counted(shots, 'shot')} recorded, {shots} valid", timeout=PROCESSED_MS)
    expect(page.get_by_label("run outcome")).to_have_text("completed")
    expect(page.get_by_role("log")).to_contain_text("shot 0 recorded")
    for view in views:  # its lamp is green for seconds only, however long the page takes to get here
        expect(page.get_by_role("status", name=re.compile(f"^{view} (live|no new picture)"))).to_be_attached()
    drawn = page.locator(".live-grid").get_attribute("data-pictures")
    assert int(drawn or 0) >= len(views), f"{drawn} pictures of {len(views)} views"
    expect(page.get_by_role("region", name="Processing").get_by_text("done").first).to_be_visible(timeout=PROCESSED_MS)
    go_to(page, "Results")
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
        image = page.get_by_role("img", name=f"slice {axis}").locator("image").first
        expect(image).to_have_attribute("href", re.compile(rf"slices/{axis}/\d+\.png"), timeout=PROCESSED_MS)
    slider = page.get_by_role("slider", name="slice y")
    before = page.get_by_role("img", name="slice y").locator("image").first.get_attribute("href")
    slider.locator("[tabindex='0']").first.focus()
    for _ in range(5):
        page.keyboard.press("ArrowRight")
    after = page.get_by_role("img", name="slice y").locator("image").first
    expect(after).not_to_have_attribute("href", before or "")
    expect(page.get_by_role("img", name="iso-surface").locator("canvas")).to_be_visible()
