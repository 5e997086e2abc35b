"""``tomoshadow report``: one page with everything in it, that a browser shows and prints."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import sync_playwright

from server.cli.main import main
from tests.support.command_line import refused, told
from tests.support.sampled_sprays import cone_shots, stored_shot, write_results

NOTES = '{"fluid": "water <pure>", "pressure_bar": 6.0, "more": {"flow_l_min": 1.25}}'


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("report")
    spray = '{"nozzle_mm": [0, 0, 0], "axis": [0, 1, 0]}'
    results = write_results(folder / "cone", cone_shots(0, 5, 120), spray=spray, notes=NOTES)
    assert main(["report", str(results), "-o", str(folder / "report.html")]) == 0
    return folder / "report.html"


def test_the_report_says_it_all_in_one_file(page: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = page.read_text()
    chapters = re.findall(r"<h2>(.*?)</h2>", text)
    assert chapters == [
        "Summary", "Where the numbers come from", "Sizes", "Velocities", "Velocity field", "Patternation",
        "Number density", "Shots", "Tables", "What the figures mean",
    ]  # fmt: skip
    assert not re.findall(r'(?:src|href)="(?!data:)', text), "nothing is fetched from elsewhere"
    for said in (
        "D32 [µm]",
        "water &lt;pure&gt;",
        "<td>1.25</td>",
        "Conditions: fluid: water &lt;pure&gt;; pressure [bar]: 6.0; flow l min: 1.25",
        "cal-1",
        "sampling: spatial",
        "lognormal",
        "Rosin-Rammler",
        "ISO 9276-1",
        "ASTM E799",
    ):
        assert said in text, said
    assert text.count("<figure>") == 6
    assert "exists; only --overwrite replaces it" in refused(capsys, "report", page.parent / "cone", "-o", page)


def test_what_shots_of_two_runs_do_not_share_is_said_of_both(tmp_path: Path) -> None:
    first = write_results(tmp_path / "first", cone_shots(0, 1, 30), run="first", notes=NOTES, tomoshadow="1.0")
    second = NOTES.replace("6.0", "20.0")
    other = write_results(tmp_path / "other", cone_shots(1, 1, 30), run="other", notes=second, tomoshadow="1.1")
    assert main(["report", str(first), str(other), "-o", str(tmp_path / "report.html")]) == 0
    text = (tmp_path / "report.html").read_text()
    assert "6.0 and 20.0" in text
    assert "measured by tomoshadow 1.0 and 1.1" in text


def test_what_is_hidden_and_what_twins_find_is_in_the_report(tmp_path: Path) -> None:
    """Half of the box is half hidden; of 200 droplets from 28 to 32 um the twins found 180."""
    percent = [[50] * 12 + [100] * 12] * 10
    twin = {"ghosts": 0, "found": 180, "classes": [{"number": 29, "placed": 200, "found": 180}]}
    told = {"verdict": "good", "hidden": {"measured_percent": {"xy": percent}}, "twins": twin}
    shots = [stored_shot(np.full(40, 30.0), shot=shot, exposures=json.dumps({"a": told})) for shot in range(2)]
    assert main(["report", str(write_results(tmp_path / "hidden", shots)), "-o", str(tmp_path / "report.html")]) == 0
    text = (tmp_path / "report.html").read_text()
    assert "Found by twins" in text
    assert "<td>90.0</td>" in text
    assert "<td>88.9 (" in text
    assert "Not corrected cell by cell" in text, "over x and z nothing is known"


@pytest.mark.slow
def test_a_browser_shows_every_picture_and_prints_pages(page: Path) -> None:
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path="/usr/bin/chromium", args=["--headless", "--no-sandbox", "--disable-gpu", "--disable-quic"]
        )
        tab = browser.new_page(viewport={"width": 1000, "height": 1000})
        tab.goto(f"file://{page}")
        widths = tab.evaluate("[...document.images].map(image => image.complete && image.naturalWidth)")
        wider = tab.evaluate("document.documentElement.scrollWidth > window.innerWidth")
        numbered = tab.evaluate("getComputedStyle(document.body).counterReset")
        printed = tab.pdf(prefer_css_page_size=True)
        browser.close()
    assert len(widths) == 6
    assert numbered == "figure 0", "figures of all chapters are numbered through"
    assert min(widths) > 300
    assert not wider
    assert printed.startswith(b"%PDF")
    assert len(re.findall(rb"/Type\s*/Page\b", printed)) in range(3, 9)


def test_of_a_few_droplets_it_says_what_there_is(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shot = cone_shots(0, 1, 3)[0]
    few = write_results(tmp_path / "few", [shot, stored_shot(shot.columns["diameter_um"][:0], shot=1)])  # type: ignore[arg-type]
    result = told(capsys, "report", few, "-o", tmp_path / "few.html")
    assert (result["report"], result["shots"]) == (str(tmp_path / "few.html"), 2)
    text = (tmp_path / "few.html").read_text()
    assert "too few droplets" in text
    assert "nozzle and axis of the spray are not known" in text
