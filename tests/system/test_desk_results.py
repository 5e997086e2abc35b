"""The pages of runs and results: whatever was recorded can be found again, and looked at; headless Chromium."""

import json
import re
import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
from playwright.sync_api import Locator, Page, expect

from processing.analysis.droplets.droplet_file import StoredDroplets
from processing.reconstruction.choices import ReconstructionMethod
from processing.reconstruction.settings import GridSettings, ReconstructionSettings
from processing.runs.volumes.pipeline import reconstruct_shots
from processing.volume import VoxelGrid
from server.lab.jobs.job import reconstruction_job
from server.lab.results import keep_preview
from server.pictures.previews import load_preview, load_provenance, save_preview
from server.web.ui.results import droplet_panel, droplet_table
from tests.server.web.test_api import wait_for_jobs
from tests.support.desk import PICTURES, PULSE, choose_calibration, without_keys
from tests.support.droplet_run import write_calibration, write_run
from tests.support.operator import go_to
from tests.support.sampled_sprays import cone_shots, write_results
from tests.support.serving import Serving, plan_of

pytestmark = pytest.mark.timeout(900)

expect.set_options(timeout=15_000)
OLD = "old-spray"
FILLED = """scene => {
    const box = getElement(scene).$el;
    return Math.abs(box.clientWidth - box.querySelector("canvas").clientWidth) < 2;
}"""
GRID = VoxelGrid.centred((41, 61, 71), 0.05)
MLOS = ReconstructionSettings(grid=GridSettings.of(GRID), minimum_window_px=0)
SMART = MLOS.model_copy(update={"method": ReconstructionMethod.SMART, "iterations": 1})


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A data directory with a run of January, reconstructed twice and measured by commands."""
    data_dir = tmp_path_factory.mktemp("kept")
    (data_dir / "calibrations").mkdir()
    calibration = write_calibration(data_dir / "calibrations" / "c.json")
    measured = [_within(shot) for shot in cone_shots(0, 2, 30)]
    cone_mm = np.stack([measured[1].columns[f"{axis}_mm"].astype(float) for axis in "xyz"], axis=1)
    run_dir = write_run(data_dir / OLD, shots=5, invalid=(2,), droplets_mm=cone_mm)
    for settings in (SMART, MLOS):
        out = run_dir / "results" / settings.results_id("c")
        list(reconstruct_shots(run_dir, [0, 1, 3], calibration, settings, out, keep=keep_preview))
    of_run = {"run": OLD, "grid": GridSettings.of(GRID).model_dump_json()}
    results_dir = write_results(run_dir / "results" / "droplets-1", measured, **of_run)
    (results_dir / "settings.json").write_text("{}")
    return data_dir


@pytest.fixture
def old_run(server: Serving, kept: Path) -> Path:
    """That run; no job of this server knows of it."""
    shutil.copytree(kept, server.services.data_dir, dirs_exist_ok=True)
    return server.services.data_dir / OLD


def _within(shot: StoredDroplets) -> StoredDroplets:
    """The cone, moved into the grid of the volumes."""
    begin_mm = {"x_mm": 0.0, "y_mm": -2.5, "z_mm": 0.0}
    moved = {name: shot.columns[name].astype(float) / 4 + begin for name, begin in begin_mm.items()}
    searched = GridSettings.of(VoxelGrid.centred((71, 61, 71), 0.05))
    provenance = {**shot.provenance, "run": OLD, "grid": searched.model_dump_json()}
    return StoredDroplets({**shot.columns, **moved}, provenance, shot.objects)


def url(server: Serving, path: str) -> str:
    return f"{server.http.base_url}/{path}"


def slice_of(page: Page, axis: str) -> Locator:
    return page.get_by_role("img", name=f"slice {axis}")


def place(page: Page, axis: str) -> Locator:
    return page.get_by_role("status", name=f"place {axis}")


def resolution(page: Page) -> Locator:
    return page.get_by_role("status", name="resolution")


def shot_shown(page: Page) -> Locator:
    return page.get_by_role("status", name="shot shown")


def choose(page: Page, label: str, option: str | re.Pattern[str]) -> None:
    page.get_by_label(label, exact=True).first.click()
    page.get_by_role("option", name=option).click()


def press(page: Page, slider: str, key: str) -> None:
    page.get_by_role("slider", name=slider, exact=True).locator("[tabindex='0']").first.focus()
    page.keyboard.press(key)


def test_before_there_is_anything_both_pages_say_what_to_do_first(page: Page, server: Serving) -> None:
    page.goto(url(server, "runs"))
    expect(page.get_by_text("Record the first one on the page Run")).to_be_visible()
    go_to(page, "Results")
    expect(page.get_by_role("status", name="results")).to_contain_text("Choose a calibration on the page Calibrate")
    expect(page.get_by_role("navigation").get_by_role("link", name="Results").get_by_label("done")).to_be_hidden()


def test_before_the_first_volume_is_there_the_page_says_that_it_is_being_made(page: Page, server: Serving) -> None:
    server.app.state.context.jobs.add(reconstruction_job("first", 0, "calibration", "mlos", {}))
    page.goto(url(server, "results"))
    expect(page.get_by_role("status", name="results")).to_have_text(
        "Run first is being worked on: what is made of its shots appears here."
    )


def test_runs_are_found_by_what_they_are(page: Page, server: Serving, old_run: Path) -> None:
    dark, _ = server.run_to_its_end(plan_of(kind="dark", name="night", shots=3, pulse=PULSE))
    notes = {"operator": "Ada", "fluid": "water", "pressure_bar": 40, "remark": "nozzle three"}
    sample, _ = server.run_to_its_end(plan_of(name="day", shots=2, pulse=PULSE, references=[dark], notes=notes))
    page.goto(url(server, "runs"))
    expect(page.get_by_role("region", name="Runs").get_by_role("link")).to_have_count(3)
    for width in (800, 1280, 1920):
        _picture(page, f"desk-runs-{width}", width)
    damaged = server.services.data_dir / "20250101T000000-damaged"
    damaged.mkdir()
    (damaged / "run.h5").write_bytes(b"no HDF5")
    page.reload()
    runs, shown = page.get_by_role("region", name="Runs"), page.get_by_role("status", name="runs shown")
    expect(runs.get_by_role("link")).to_have_text([sample, dark, OLD, damaged.name])
    expect(runs.get_by_role("row", name=OLD)).to_contain_text("4 / 5")
    expect(runs.get_by_role("row", name=damaged.name)).to_contain_text("tomoshadow repair")
    page.get_by_label("search runs").fill("ADA water")
    expect(shown).to_have_text("1 to 1 of 1")
    expect(runs.get_by_role("link")).to_have_text([sample])
    page.get_by_label("search runs").fill("no such words")
    expect(page.get_by_text("No run is like that")).to_be_visible()
    page.get_by_label("search runs").fill("")
    choose(page, "kind of runs", "dark")
    expect(runs.get_by_role("link")).to_have_text([dark])
    choose(page, "kind of runs", "any kind")
    choose(page, "results of runs", "with results")
    expect(runs.get_by_role("link")).to_have_text([OLD])


def test_a_run_shows_its_shots_and_why_one_is_invalid(page: Page, server: Serving, old_run: Path) -> None:
    page.goto(url(server, f"runs/{OLD}/shots/1"))
    fault = page.get_by_role("status", name="fault of the shot")
    expect(shot_shown(page)).to_have_text("shot 1 (2 of 5)")
    expect(fault).to_have_text("")
    press(page, "shot", "ArrowRight")
    expect(shot_shown(page)).to_have_text("shot 2 (3 of 5)")
    expect(fault).to_have_text("INVALID: no exposure B of view2")
    expect(page).to_have_url(re.compile("/runs/old-spray/shots/2$"))
    page.get_by_role("button", name="next invalid").click()
    expect(shot_shown(page)).to_have_text("shot 2 (3 of 5)")
    for view in ("view1", "view2", "view3"):
        for name in "AB":
            picture = page.get_by_alt_text(f"{view} exposure {name}")
            picture.scroll_into_view_if_needed()
            expect(picture).to_have_js_property("complete", True)
            assert picture.evaluate("image => image.naturalWidth") > 0
    for width in (800, 1280):
        _picture(page, f"one-run-{width}", width)
    page.get_by_role("link", name="Results", exact=True).last.click()
    expect(page).to_have_url(re.compile("/results/old-spray/"))


def test_what_is_not_there_is_told_with_the_way_back(page: Page, server: Serving, old_run: Path) -> None:
    page.goto(url(server, "runs/nowhere/shots/7"))
    expect(page.get_by_text("there is no run 'nowhere'")).to_be_visible()
    page.get_by_role("link", name="All runs").click()
    expect(page.get_by_role("region", name="Runs").get_by_role("link", name=OLD)).to_be_visible()
    page.goto(url(server, "results/nowhere/mlos-1/0"))
    expect(page.get_by_role("status", name="results")).to_contain_text("there is no run 'nowhere'")
    page.goto(url(server, f"results/{OLD}/mlos-gone/99"))
    expect(shot_shown(page)).to_have_text("shot 3 (3 of 3)")


def test_volumes_of_an_old_run_are_seen_from_all_sides_at_full_resolution(
    page: Page, server: Serving, old_run: Path
) -> None:
    page.goto(url(server, f"results/{OLD}"))
    expect(resolution(page)).to_have_text("MLOS, full resolution")
    for axis in "xyz":
        pictures = slice_of(page, axis).locator("image")
        expect(pictures).to_have_count(2)
        expect(pictures.last).to_have_attribute("href", re.compile(rf"slice\.png\?axis={axis}&"))
    before = {axis: place(page, axis).inner_text() for axis in "xyz"}
    slice_of(page, "z").locator("svg").click(position={"x": 120, "y": 90})
    for axis in "xy":
        expect(place(page, axis)).not_to_have_text(before[axis])
    expect(place(page, "z")).to_have_text(before["z"])
    press(page, "slice z", "ArrowRight")
    expect(place(page, "z")).not_to_have_text(before["z"])
    expect(slice_of(page, "z").locator("image").last).to_have_attribute("href", re.compile(r"slice\.png"))
    page.get_by_role("button", name="maxima").click()
    expect(place(page, "z")).to_have_text("maximum along z")
    expect(slice_of(page, "z").locator("image")).to_have_attribute("href", re.compile("projections/z.png"))
    page.get_by_role("button", name="slices", exact=True).click()
    expect(page.get_by_role("img", name="iso-surface").locator("canvas")).to_be_visible()


def test_both_exposures_lie_one_upon_the_other_and_another_method_is_tried(
    page: Page, server: Serving, old_run: Path
) -> None:
    page.goto(url(server, f"results/{OLD}/{MLOS.results_id('c')}/1"))
    expect(resolution(page)).to_have_text("MLOS, full resolution")
    page.get_by_role("button", name="both").click()
    addresses = slice_of(page, "y").locator("image")
    expect(addresses).to_have_count(4)
    expect(addresses.nth(1)).to_have_attribute("href", re.compile("_a/slice.png.*colours=blue"))
    expect(addresses.nth(3)).to_have_attribute("href", re.compile("_b/slice.png.*colours=red"))
    choose(page, "Slices, region by", "MINLOS")
    expect(resolution(page)).to_have_text("MINLOS, full resolution")
    expect(addresses.nth(3)).to_have_attribute("href", re.compile("method=minlos"))
    page.get_by_role("button", name="region").click()
    expect(resolution(page)).to_have_text("MINLOS, full resolution")
    expect(addresses.nth(3)).to_have_attribute("href", re.compile(r"_b/region\.png.*method=minlos"))
    at_mm = float((slice_of(page, "y").get_attribute("data-at") or "").split()[0])
    frames = page.locator(".slice-view .slice-frame")
    expect(frames).to_have_count(3)
    page.get_by_label("Region ± / mm").fill("0.4")
    expect(place(page, "x")).to_have_text(f"maximum along x, {at_mm - 0.4:.3f} to {at_mm + 0.4:.3f} mm")
    for number in (1, 3):
        expect(addresses.nth(number)).to_have_attribute("href", re.compile(rf"x_mm={at_mm - 0.4:.3f}\d+%3A"))
        assert page.request.get(url(server, (addresses.nth(number).get_attribute("href") or "").lstrip("/"))).ok
    page.get_by_role("button", name="maxima").click()
    expect(resolution(page)).to_contain_text("MLOS, preview only: these are the largest values of all")
    expect(frames).to_have_count(0)
    page.get_by_role("button", name="slices", exact=True).click()
    choose(page, "Result set", re.compile("SMART"))
    choose(page, "Slices, region by", re.compile("as made, SMART"))
    expect(resolution(page)).to_contain_text("SMART, preview only")
    expect(addresses).to_have_count(2)


def test_what_speaks_against_a_volume_is_told_beside_its_slices(page: Page, server: Serving, old_run: Path) -> None:
    """No job of this server knows of it, and a volume of which a view saw nothing looks as fine as any other."""
    results_id = MLOS.results_id("c")
    stored = old_run / "results" / results_id / "shot_00001_a.preview.npz"
    spoken = {"verdict": "warn", "shots": [{"shot": 3}]}
    told = {"blind_views": json.dumps(["view2"]), "belonging": json.dumps(spoken)}
    save_preview(stored, load_preview(stored), {**load_provenance(stored), **told})
    page.goto(url(server, f"results/{OLD}/{results_id}/1"))
    expect(resolution(page)).to_have_text("MLOS, full resolution")
    expect(page.get_by_text("exposure A: view2 sees nothing")).to_be_visible()
    expect(page.get_by_text("droplets speak against run and calibration: warn (shot 3)")).to_be_visible()
    page.goto(url(server, f"results/{OLD}/{results_id}/3"))
    expect(resolution(page)).to_have_text("MLOS, full resolution")
    expect(page.get_by_text("exposure A: view2 sees nothing")).to_be_hidden()


def test_what_tables_of_droplets_leave_out_is_told(
    page: Page, server: Serving, old_run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a shot with more droplets than are listed the count was that of the rows."""
    monkeypatch.setattr(droplet_table, "_SHOWN", 7)
    monkeypatch.setattr(droplet_panel, "_SHOWN", 0)
    page.goto(url(server, f"results/{OLD}/{MLOS.results_id('c')}/1"))
    with h5py.File(old_run / "results" / "droplets-1" / "shot_00001_droplets.h5") as file:
        there = len(file["droplets/frame"])
    expect(page.get_by_text(f"{there} droplets, the largest 7 are listed")).to_be_visible()
    expect(page.get_by_text("and 1 older set, not told here")).to_be_visible()


def test_droplets_lie_over_the_slices_and_in_a_table_that_leads_to_them(
    page: Page, server: Serving, old_run: Path
) -> None:
    page.goto(url(server, f"results/{OLD}/{MLOS.results_id('c')}/1"))
    table = page.get_by_role("region", name="Droplets of this shot")
    expect(table).to_contain_text(re.compile(r"\d+ droplets"))
    first = table.get_by_role("row").nth(1)
    at_mm = {axis: float(first.get_by_role("cell").nth(1 + number).inner_text()) for number, axis in enumerate("xyz")}
    first.click()
    expect(place(page, "x")).to_have_text(re.compile(f"x = {round(at_mm['x'] / 0.05) * 0.05:.3f} mm"))
    expect(page.get_by_role("switch", name="droplets")).to_be_in_viewport()
    depths_mm = [float(row.get_by_role("cell").nth(3).inner_text()) for row in table.get_by_role("row").all()[1:]]
    beside = next(number for number, z_mm in enumerate(depths_mm, 1) if abs(z_mm) > 0.5 * 41 * 0.05)
    table.get_by_role("row").nth(beside).click()
    outside = page.get_by_text("This droplet lies outside of the volume, along z")
    expect(outside).to_be_visible()
    first.click()
    expect(outside).to_be_hidden(timeout=6_000)
    assert without_keys(page) == []
    table.get_by_role("columnheader", name="x, mm").focus()
    page.keyboard.press("Enter")
    expect(table.get_by_role("columnheader", name="x, mm")).to_have_class(re.compile(r"\bsorted\b"))
    second = table.get_by_role("row").nth(2)
    x_mm = float(second.get_by_role("cell").nth(1).inner_text())
    second.focus()
    page.keyboard.press("Enter")
    expect(place(page, "x")).to_have_text(re.compile(f"x = {round(x_mm / 0.05) * 0.05:.3f} mm"))
    assert slice_of(page, "z").locator("circle").count() > 0
    page.get_by_role("button", name="B", exact=True).click()
    expect(slice_of(page, "z").locator("circle")).to_have_count(0)
    second.click()
    expect(page.get_by_role("button", name="A", exact=True)).to_have_attribute("aria-pressed", "true")
    expect(slice_of(page, "z").locator("circle")).not_to_have_count(0)
    expect(page.get_by_role("region", name="Droplets", exact=True)).to_contain_text("droplets-1")
    press(page, "shot", "ArrowRight")
    expect(shot_shown(page)).to_have_text("shot 3 (3 of 3)")
    expect(table).to_be_hidden()


def test_where_no_volume_is_shown_no_row_of_a_droplet_promises_to_lead_there(
    page: Page, server: Serving, old_run: Path
) -> None:
    page.goto(url(server, f"results/{OLD}/droplets-1/1"))
    table = page.get_by_role("region", name="Droplets of this shot")
    expect(table).to_contain_text("droplets; choose volumes above to see where they lie")
    assert table.locator("tbody tr[tabindex], tbody tr.cursor-pointer").count() == 0


def test_the_camera_stays_when_the_shot_changes(page: Page, server: Serving, old_run: Path) -> None:
    page.goto(url(server, f"results/{OLD}/{MLOS.results_id('c')}/0"))
    expect(resolution(page)).to_have_text("MLOS, full resolution")
    scene = page.get_by_role("img", name="iso-surface")
    scene.scroll_into_view_if_needed()
    at_first = _camera(scene)
    scene.locator("canvas").drag_to(scene, source_position={"x": 60, "y": 60}, target_position={"x": 160, "y": 120})
    dragged = _camera(scene)
    assert dragged != at_first
    scene.focus()
    page.keyboard.press("Shift+ArrowRight")
    page.wait_for_function(
        "([scene, x]) => Math.abs(getElement(scene).camera.position.x - x) > 1e-3", arg=[_id(scene), dragged[0]]
    )
    turned = _camera(scene)
    press(page, "shot", "ArrowRight")
    expect(shot_shown(page)).to_have_text("shot 1 (2 of 3)")
    expect(resolution(page)).to_have_text("MLOS, full resolution")
    assert _camera(scene) == pytest.approx(turned, rel=1e-3)
    page.get_by_role("button", name="see the whole volume").click()
    page.wait_for_function(
        "([scene, at]) => Math.abs(getElement(scene).camera.position.x - at) < 1e-3", arg=[_id(scene), at_first[0]]
    )


def test_the_scene_fills_its_place_when_the_drawer_comes_and_goes(page: Page, server: Serving, old_run: Path) -> None:
    page.goto(url(server, f"results/{OLD}/{MLOS.results_id('c')}/0"))
    scene = page.get_by_role("img", name="iso-surface")
    for _ in range(2):
        page.get_by_role("button", name="jobs and events").click()
        page.wait_for_timeout(300)
        page.wait_for_function(FILLED, arg=_id(scene))


def _id(scene: Locator) -> int:
    return int(scene.evaluate("element => Number(element.id.slice(1))"))


def _camera(scene: Locator) -> list[float]:
    return list(scene.page.evaluate("scene => getElement(scene).camera.position.toArray()", _id(scene)))


def test_the_shot_that_a_hand_has_picked_is_never_torn_away(page: Page, server: Serving, old_run: Path) -> None:
    page.goto(url(server, "results"))
    choose_calibration(server)
    sample, _ = server.run_to_its_end(plan_of(name="later", shots=2, pulse=PULSE))
    wait_for_jobs(server, 2)
    expect(shot_shown(page)).to_have_text("shot 1 (2 of 2)")
    expect(page).to_have_url(re.compile("/results$"))
    page.reload()
    expect(shot_shown(page)).to_have_text("shot 1 (2 of 2)")
    expect(page.get_by_role("switch", name="newest")).to_be_checked()
    expect(page.get_by_role("navigation").get_by_role("link", name="Results").get_by_label("done")).to_be_visible()
    expect(page.get_by_role("status", name="work on this run")).to_contain_text("2 of 2 shots done")
    expect(page.get_by_label("Result set", exact=True).first).to_have_value(re.compile("MLOS nominal"))
    press(page, "shot", "ArrowLeft")
    expect(shot_shown(page)).to_have_text("shot 0 (1 of 2)")
    newest, _ = server.run_to_its_end(plan_of(name="newest", shots=1, pulse=PULSE))
    wait_for_jobs(server, 3)
    page.get_by_role("button", name="jobs and events").click()
    expect(page.get_by_role("region", name="Processing")).to_contain_text(newest)
    expect(page).to_have_url(re.compile(f"/results/{sample}/.*/0$"))
    page.get_by_role("switch", name="newest").click()
    expect(page.get_by_role("combobox", name="Run", exact=True)).to_have_value(re.compile(newest))
    expect(page).to_have_url(re.compile("/results$"))
    page.get_by_role("switch", name="newest").click()
    expect(page).to_have_url(re.compile(f"/results/{newest}/.*/0$"))


def test_a_run_is_changed_and_deleted_by_nobody_while_somebody_else_holds_control(page: Page, server: Serving) -> None:
    run_id, _ = server.run_to_its_end(plan_of(kind="dark", shots=1, pulse=PULSE))
    server.free_control()
    page.goto(f"{server.http.base_url}/runs/{run_id}")
    buttons = [page.get_by_role("button", name=name) for name in ("Edit notes...", "Delete...")]
    for button in buttons:
        expect(button).to_be_enabled()
    server.http.put("/api/rig/control", headers={"Tomoshadow-Operator": "ann@lab"}).raise_for_status()
    for button in buttons:
        expect(button).to_be_disabled()
        expect(button).to_have_attribute(
            "title", "ann@lab holds control of this rig: the hand in the bar takes it over"
        )
    server.free_control()
    for button in buttons:
        expect(button).to_be_enabled()
        expect(button).not_to_have_attribute("title", re.compile("."))


def test_notes_are_changed_on_the_page_and_nobody_overwrites_what_another_wrote(page: Page, server: Serving) -> None:
    noted = {"fluid": "water", "more": {"flow_l_min": 1.2}}
    run_id, _ = server.run_to_its_end(plan_of(kind="dark", shots=1, pulse=PULSE, notes=noted))
    server.free_control()
    address = f"/api/runs/{run_id}/notes"
    page.goto(f"{server.http.base_url}/runs/{run_id}")
    page.get_by_role("button", name="Edit notes...").click()
    page.get_by_role("textbox", name="Fluid").fill("ethanol")
    server.http.put(address, json={"notes": noted | {"fluid": "oil"}}).raise_for_status()
    page.get_by_role("button", name="Save notes").click()
    expect(page.get_by_role("alert").filter(has_text="changed by")).to_be_visible()
    expect(page.get_by_role("textbox", name="Fluid")).to_have_value("ethanol")
    page.get_by_role("button", name="Leave as they are").click()
    page.get_by_role("button", name="Edit notes...").click()
    expect(page.get_by_role("textbox", name="Fluid")).to_have_value("oil")
    page.get_by_role("textbox", name="Fluid").fill("ethanol")
    page.get_by_role("textbox", name="Orifice at").fill("0, -8.4")
    page.get_by_role("button", name="Save notes").click()
    expect(page.get_by_role("alert").filter(has_text="nozzle_mm")).to_be_visible()
    page.get_by_role("textbox", name="Orifice at").fill("0, -8.4, 0")
    page.get_by_role("button", name="Save notes").click()
    expect(page.get_by_role("status", name="notes")).to_contain_text("ethanol · flow_l_min: 1.2 · changed by")
    changes = server.http.get(address).json()["changes"]
    assert [change["notes"]["fluid"] for change in changes] == ["oil", "ethanol"]
    assert changes[-1]["spray"] == {"nozzle_mm": [0, -8.4, 0], "axis": [0, 1, 0]}
    before = page.get_by_role("status", name="what stood in them before")
    placed = "and put the orifice at 0, -8.4, 0 mm, the axis along 0, 1, 0"
    expect(before).to_have_text(
        re.compile(rf"^until .*changed it {placed}: oil · flow.*\nuntil .*: water · flow_l_min: 1\.2$")
    )


def test_a_run_is_deleted_by_its_name_alone(page: Page, server: Serving) -> None:
    run_id, _ = server.run_to_its_end(plan_of(kind="dark", name="in vain", shots=1, pulse=PULSE))
    page.goto(url(server, f"runs/{run_id}".replace(" ", "%20")))
    page.get_by_role("button", name="Delete...").click()
    confirm = page.get_by_role("button", name="Delete", exact=True)
    expect(confirm).to_be_disabled()
    page.get_by_label("Name of the run").fill("in vain")
    expect(confirm).to_be_disabled()
    page.get_by_label("Name of the run").fill(run_id)
    confirm.click()
    expect(page).to_have_url(re.compile("/runs$"))
    expect(page.get_by_role("region", name="Runs").get_by_role("link", name=run_id)).to_have_count(0)
    assert not (server.services.data_dir / run_id).exists()


@pytest.mark.parametrize("width", [800, 1280, 1920])
def test_the_page_of_results_fits_every_width(page: Page, server: Serving, old_run: Path, width: int) -> None:
    page.set_viewport_size({"width": width, "height": 1000})
    page.goto(url(server, f"results/{OLD}/{MLOS.results_id('c')}/1"))
    expect(resolution(page)).to_have_text("MLOS, full resolution")
    page.get_by_role("button", name="both").click()
    expect(slice_of(page, "y").locator("image")).to_have_count(4)
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth"), "the page is wider than the window"
    chosen = page.get_by_role("region", name="Result", exact=True).locator(".q-field__native > span")
    assert chosen.evaluate_all("found => found.filter(one => one.scrollWidth > one.clientWidth + 1).length") == 0
    _picture(page, f"desk-results-{width}", width)


def _picture(page: Page, name: str, width: int) -> None:
    """Light, as the system of a test is, and dark."""
    if not PICTURES:
        return
    page.set_viewport_size({"width": width, "height": 1000})
    for shade in ("light", "dark"):
        page.wait_for_timeout(1500)
        page.screenshot(path=str(Path(PICTURES) / f"{name}-{shade}.png"))
        page.get_by_role("button", name="dark or light").click()


def test_an_address_with_any_name_says_what_is_wrong_and_the_page_goes_on(page: Page, server: Serving) -> None:
    for name in ("none", 'say "hi"', "a%00b", "nozzle %233", "it's"):
        page.goto(url(server, f"results/{name}"))
        expect(page.get_by_role("status", name="results")).to_contain_text("choose another one above")
        expect(page.get_by_role("link", name="Open the run")).to_have_attribute("href", re.compile("^/runs/."))
        page.goto(url(server, f"runs/{name}"))
        expect(page.get_by_role("region", name="Run").get_by_role("link", name="All runs")).to_be_visible()


def test_a_run_that_is_deleted_elsewhere_is_gone_from_every_open_page(page: Page, server: Serving) -> None:
    doomed, _ = server.run_to_its_end(plan_of(kind="dark", name="doomed", shots=1, pulse=PULSE))
    page.goto(url(server, f"runs/{doomed}"))
    expect(page.get_by_role("button", name="Delete...")).to_be_visible()
    page.wait_for_load_state("networkidle")  # its pictures are there
    server.http.delete(f"/api/runs/{doomed}", headers={"Tomoshadow-Name": doomed}).raise_for_status()
    expect(page.get_by_text(f"there is no run '{doomed}': it was deleted")).to_be_visible()
    expect(page.get_by_role("button", name="Delete...")).to_be_hidden()


def test_of_a_run_without_results_nothing_is_downloaded(page: Page, server: Serving, old_run: Path) -> None:
    dark, _ = server.run_to_its_end(plan_of(kind="dark", shots=1, pulse=PULSE))
    page.goto(url(server, f"results/{dark}"))
    expect(page.get_by_role("status", name="results")).to_contain_text("is a dark run")
    expect(page.get_by_role("region", name="Reconstruct or measure this run")).to_be_hidden()
    page.get_by_role("button", name="Download").click()
    expect(page.get_by_text("nothing", exact=True)).to_be_visible()
