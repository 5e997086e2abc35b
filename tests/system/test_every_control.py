"""Every control of every page: those that the accessibility tree tells of are those that are touched here.

A page is gone through in the order of its table. Whatever a touch brings into sight is read too, so a control that is
added anywhere, or is no longer there, fails; and each has to do something. Headless Chromium.
"""

import re
import shutil
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Literal

import pytest
from playwright.sync_api import Locator, Page, expect

from server.web.ui.runs.run_list import PAGE
from tests.support.desk import PULSE, show_spray, without_keys
from tests.support.live_shots import save_droplet_calibration
from tests.support.serving import Serving, plan_of

pytestmark = pytest.mark.timeout(900)

Role = Literal["button", "link", "textbox", "spinbutton", "combobox", "slider", "switch", "checkbox"]
ROLES = ("button", "link", "textbox", "spinbutton", "combobox", "slider", "switch", "checkbox", "radio", "tab")
CONTROL = re.compile(rf'^\s*- \'?({"|".join(ROLES)}) "((?:[^"\\]|\\.)*)"', re.MULTILINE)


@dataclass(frozen=True)
class Touch:
    """A control, and what is to be seen once it was touched; by itself that is what every control of its role does."""

    role: Role
    name: str
    sees: Callable[[Page], Locator] | None = None
    text: str = "2"


def press(name: str, sees: Callable[[Page], Locator] | None = None) -> Touch:
    return Touch("button", name, sees)


def status(name: str, text: str = "") -> Callable[[Page], Locator]:
    return lambda page: page.get_by_role("status", name=name).filter(has_text=re.compile(text))


def pressed(name: str) -> Touch:
    return press(name, lambda page: page.get_by_role("button", name=name, exact=True, pressed=True))


def region(name: str) -> Callable[[Page], Locator]:
    return lambda page: page.get_by_role("region", name=name, exact=True)


def option(name: str) -> Callable[[Page], Locator]:
    return lambda page: page.get_by_role("button", name=name, exact=True)


def notice(page: Page) -> Locator:
    return page.locator(".q-notification")


def box(name: str) -> Callable[[Page], Locator]:
    return lambda page: page.get_by_role("combobox", name=name)


def fields(role: Role, *names: str, text: str = "2") -> tuple[Touch, ...]:
    return tuple(Touch(role, name, text=text) for name in names)


RAIL = ("Live", "Calibrate", "Run", "Results", "Runs", "Rig")
"""The last one leads back to the page where the bar is gone through."""
BAR = (
    *(Touch("link", title) for title in RAIL),
    press("ABORT", lambda page: page.get_by_role("alert", name="abort answer").filter(has_text="light off confirmed")),
    press("why this state", region("reasons against a start")),
    press("jobs and events", lambda page: page.get_by_role("log")),
    *fields("textbox", "Filter jobs and events", text="shot"),
    press("dark or light", lambda page: page.locator(".body--dark")),
    press("control: free", region("control of the rig")),
    press("Take control", option("control: you")),
    press("control: you", region("control of the rig")),
    *fields("textbox", "Your name", text="ann"),
    press("Give control back", option("control: free")),
)
PULSES = (*fields("spinbutton", "Separation / ns", text="6400"), *fields("spinbutton", "Pulse width / ns", text="900"))
TABLES: dict[str, tuple[Touch, ...]] = {
    "/rig": (*BAR, press("Reconnect", region("view1")), press("Examine", status("doctor", "things looked at"))),
    "/live": (
        *PULSES,
        *fields("spinbutton", "Live / Hz", "LED view1 / A"),
        Touch("slider", "LED view1 current"),
        *(pressed(f"view1 {name}") for name in ("exposure A", "exposure B", "stretched grey scale", "hidden")),
        pressed("Cross-hair"),
        pressed("Loupe 1:1"),
        Touch("link", "All edges of the shot"),
        press("Shoot one", option("Keep shot")),
        press("Keep shot", status("view1 newest shot", "hidden")),
        press("Live", option("Apply")),
        Touch("switch", "Pulsed light"),
        press("Apply", status("rig state", "LIVE")),
        press("Set to half range", status("light assistant", "By shot")),
        Touch("switch", "live slices"),
        *(Touch("slider", f"place of live slice {axis}") for axis in "xyz"),
        Touch("switch", "live iso-surface"),
        press("End live", status("rig state", "READY")),
    ),
    "/calibrate": (
        *fields("combobox", "Kind of camera"),
        press("Show", region("Calibration")),
    ),
    "/run": (
        *PULSES,
        *(pressed(kind) for kind in ("Background", "Calibration")),
        *fields("spinbutton", "Shots", text="0"),
        Touch("link", "to the form"),
        *(pressed(kind) for kind in ("Dark", "Sample")),
        *fields("spinbutton", "Rate / Hz", "LED view1 / A", "Pressure / bar"),
        *fields("spinbutton", "Shots", text="1000"),
        *fields("textbox", "Name", "Operator", "Fluid", "Nozzle", "Remark", text="x"),
        *fields("combobox", "Volumes", "Calibration; none: current", "Dark and background runs", "Template"),
        Touch("checkbox", "Droplets too"),
        *fields("textbox", "Box of the droplets / mm", text="-1:1,-1:1,-1:1"),
        Touch("checkbox", "Droplets too"),
        press("keep as a template", option("Save template")),
        *fields("textbox", "Save as", text="kept"),
        press("Save template", box("Template")),
        press("keep as a template", option("Remove the chosen one")),
        press("Remove the chosen one", box("Template")),
        press('Collapse "Notes"', option('Expand "Notes"')),
        press('Expand "Notes"', option('Collapse "Notes"')),
        press("Remove", box("Dark and background runs")),
        press("Start run", status("rig state", "ACQUIRING")),
        press("Stop", status("rig state", "READY")),
    ),
    "/results/RUN": (
        *fields("combobox", "Run", "Result set", "Slices, region by", "Method", "Accuracy", "Voxels"),
        *(Touch("slider", name) for name in ("shot", "slice x", "slice y", "slice z", "iso level")),
        *(pressed(name) for name in ("B", "both", "A", "maxima", "region")),
        *fields("spinbutton", "Region ± / mm"),
        pressed("slices"),
        press("see the whole volume", lambda page: page.get_by_role("img", name="iso-surface").locator("canvas")),
        press("Download", lambda page: page.locator(".q-menu a").first),
        *(Touch("link", f"Volume {exposure} for ParaView (VTKHDF)") for exposure in "AB"),
        Touch("switch", "newest"),
        press("Reconstruct", notice),
        *fields("textbox", "Box / mm", text="-1:1,-1:1,-1:1"),
        press("Measure", notice),
        Touch("link", "Open the run"),
    ),
    "/runs": (
        *fields("textbox", "search runs", text=""),
        *fields("combobox", "kind of runs", "outcome of runs", "results of runs"),
        press("older runs", status("runs shown", f"^{PAGE + 1} to")),
        press("newer runs", status("runs shown", "^1 to")),
        Touch("link", "RUN"),
    ),
    "/runs/RUN": (
        Touch("link", "All runs"),
        Touch("slider", "shot"),
        *fields("combobox", "Method", "Accuracy", "Voxels"),
        press("Reconstruct", notice),
        *fields("textbox", "Box / mm", text="-1:1,-1:1,-1:1"),
        press("Measure", notice),
        press("Edit notes...", option("Leave as they are")),
        press("Leave as they are", status("shot shown")),
        press("Edit notes...", option("Save notes")),
        *fields("textbox", "Operator", "Fluid", "Nozzle", "Remark", text="x"),
        *fields("spinbutton", "Pressure / bar"),
        *fields("textbox", "Orifice at x, y, z / mm", "Axis of the spray x, y, z", text="0, -8, 1"),
        press("Save notes", status("notes", "x · x · x · 2 bar · x · changed by")),
        press("Delete...", option("Keep it")),
        press("Keep it", status("shot shown")),
        press("Delete...", option("Keep it")),
        *fields("textbox", "Name of the run", text="RUN"),
        press("Delete", region("Runs")),
    ),
}

SOMETIMES = {("button", "Acknowledge fault"), ("switch", "droplets")}
"""There while a fault is, as a busy machine may be late with the generator's answer, and once a measurement has ended.

test_desk.py touches the alarm of such a fault, test_desk_results.py the switch.
"""


@pytest.mark.parametrize("path", TABLES)
def test_every_control_of_a_page_is_touched_and_does_something(page: Page, server: Serving, path: str) -> None:
    run_id, read = prepared(server, PAGE if path == "/runs" else 0), set[tuple[str, str]]()
    page.goto(f"{server.http.base_url}{path.replace('RUN', run_id)}")
    for one in TABLES[path]:
        found(page, one).wait_for()
        if path.replace("RUN", run_id) in page.url:
            read |= controls(page)
        DEEDS.get(one.role, click)(page, found(page, one), replace(one, text=one.text.replace("RUN", run_id)))
    assert without_keys(page) == [], "these can be clicked, and no key reaches them"
    touched = names(TABLES[path])
    assert read - touched - names(BAR) - SOMETIMES == set(), "nobody touches these"
    assert touched - read == set(), "these are touched, and the accessibility tree does not tell of them"


def prepared(server: Serving, more_runs: int) -> str:
    """Whatever a page may offer is there, and nobody holds control; a run with results."""
    show_spray(server)
    save_droplet_calibration(server.services.data_dir / "calibrations" / "paper.json")
    server.http.put("/api/calibrations/current", json={"id": "paper"}).raise_for_status()
    dark, _ = server.run_to_its_end(plan_of(kind="dark", shots=1, pulse=PULSE))
    run_id, _ = server.run_to_its_end(plan_of(shots=3, pulse=PULSE))
    for number in range(more_runs):
        shutil.copytree(server.services.data_dir / dark, server.services.data_dir / f"{dark}{number}")
    (server.services.data_dir / "templates").mkdir(exist_ok=True)
    (server.services.data_dir / "templates" / "bright.json").write_text('{"shots": 77}')
    server.free_control()
    return run_id


def controls(page: Page) -> set[tuple[str, str]]:
    """Role and name of what can be touched, a run or view for all; of those without a name axe-core complains."""
    return {
        (role, alike(name.replace('\\"', '"'))) for role, name in CONTROL.findall(page.locator("body").aria_snapshot())
    }


def names(touches: Iterable[Touch]) -> set[tuple[str, str]]:
    return {(one.role, alike(one.name)) for one in touches}


def alike(name: str) -> str:
    for differs, stands_for in ((r"view\d", "view1"), (r"^\d{8}T\d{6}-.*", "RUN"), ("^control: .*", "control: free")):
        name = re.sub(differs, stands_for, name)
    return name


def found(page: Page, one: Touch) -> Locator:
    name = re.compile(r"^\d{8}T") if one.name == "RUN" else one.name
    return page.get_by_role(one.role, name=name, exact=True).first


def click(page: Page, control: Locator, one: Touch) -> None:
    control.click()
    if one.sees:
        expect(one.sees(page).first).to_be_visible()


def fill(page: Page, control: Locator, one: Touch) -> None:
    control.fill(one.text)
    expect(control).to_have_value(one.text)


def choose(page: Page, control: Locator, one: Touch) -> None:
    until(control.click, lambda limit_ms: expect(page.get_by_role("listbox")).to_be_visible(timeout=limit_ms))
    page.keyboard.press("Escape")
    expect(page.get_by_role("listbox")).to_be_hidden()


def slide(page: Page, control: Locator, one: Touch) -> None:
    if name_of(control) == "INPUT":
        before = control.input_value()
        control.press("ArrowRight")
        expect(control).not_to_have_value(before)
        return
    before = control.get_attribute("aria-valuenow") or ""

    def move() -> None:
        control.locator("[tabindex='0']").first.focus()
        page.keyboard.press("ArrowLeft" if before == control.get_attribute("aria-valuemax") else "ArrowRight")

    until(move, lambda limit_ms: expect(control).not_to_have_attribute("aria-valuenow", before, timeout=limit_ms))


def until(act: Callable[[], object], seen: Callable[[float], object], tries: int = 6) -> None:
    """Act again where nothing came of it: a page that is being filled may take no notice of the first touch."""
    for _ in range(tries - 1):
        act()
        with suppress(AssertionError):
            seen(10_000)
            return
    act()
    seen(60_000)


def name_of(control: Locator) -> str:
    return str(control.evaluate("one => one.tagName"))


def switch(page: Page, control: Locator, one: Touch) -> None:
    before = control.is_checked()
    control.click()
    expect(control).to_be_checked(checked=not before)


def follow(page: Page, control: Locator, one: Touch) -> None:
    before = page.url
    address = control.get_attribute("href")
    assert address
    if control.get_attribute("target") == "_blank" or control.get_attribute("download") is not None:
        assert page.request.get("/".join(page.url.split("/")[:3]) + address).ok
        return
    control.click()
    if not before.endswith(address):
        expect(page).not_to_have_url(before)
        if one.name not in RAIL:
            page.go_back()
            expect(control).to_be_visible()


DEEDS = {
    "textbox": fill,
    "spinbutton": fill,
    "combobox": choose,
    "slider": slide,
    "switch": switch,
    "checkbox": switch,
    "link": follow,
}
