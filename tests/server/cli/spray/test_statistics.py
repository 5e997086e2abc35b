"""``tomoshadow statistics``: shots are pooled where they belong together, compared where they do not, else refused."""

import json
from pathlib import Path

import numpy as np
import pytest

from processing.analysis.spray.spray_statistics import SprayStatistics
from processing.runs.liquid.objects import NO_OBJECTS
from tests.support.command_line import refused, shown, told
from tests.support.sampled_sprays import cone_shots, in_box, stored_shot, write_results

SPRAY = '{"nozzle_mm": [0, 0, 0], "axis": [0, 1, 0]}'


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two days of one spray, in one directory each."""
    folder = tmp_path_factory.mktemp("results")
    write_results(folder / "monday", cone_shots(0, 5, 120), run="monday", spray=SPRAY)
    write_results(folder / "tuesday", cone_shots(1, 5, 60), run="tuesday", spray=SPRAY)
    return folder


def test_shots_of_all_results_are_pooled_and_the_run_says_where_the_nozzle_is(
    results: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    one = told(capsys, "statistics", results / "monday", "--liquid-density", 998)
    both = told(capsys, "statistics", results / "monday", results / "tuesday")
    above = told(capsys, "statistics", results)
    assert (one.pop("results"), one.pop("conditions_changed")) == ("monday", [])
    assert one.pop("liquid")["break_up_reason"] == NO_OBJECTS
    assert SprayStatistics.model_validate(one).extent
    assert both["droplets"]["shots"] == above["droplets"]["shots"] == 10
    assert both["droplets"] == above["droplets"]
    flux = one["motion"]["volume_flux_mm_s"]["value"]
    assert one["motion"]["mass_flux_kg_m2_s"]["value"] == pytest.approx(0.998 * flux)
    assert one["patternations"][0]["at_mm"] == pytest.approx(10)


def test_of_a_run_its_own_results_are_taken_where_there_is_no_choice(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = tmp_path / "monday"
    (run / "results").mkdir(parents=True)
    (run / "run.h5").touch()
    assert "is a run, and its own results have no droplets" in refused(capsys, "statistics", run)
    write_results(run / "results" / "droplets-1", cone_shots(0, 2, 30), run="monday", spray=SPRAY)
    assert told(capsys, "statistics", run)["results"] == "monday/droplets-1"
    write_results(run / "results" / "droplets-2", cone_shots(0, 2, 30), run="monday", spray=SPRAY)
    assert f"name one of {run / 'results' / 'droplets-1'}, " in refused(capsys, "statistics", run)


def test_people_read_figures_with_units_and_intervals(results: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = shown(capsys, "statistics", results / "monday", "--at", "9")
    assert "sampling: spatial" in text
    assert "D32 [µm]" in text
    assert "volume flux [mm³/(mm² s)]" in text
    assert "sample: low sample" in text


def test_people_read_that_a_and_b_show_the_same_droplets(
    results: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    said = {"exposures": json.dumps({frame: {"verdict": "good", "reasons": []} for frame in "ab"})}
    double = write_results(tmp_path / "double", cone_shots(0, 5, 60), **said)
    assert "exposures: 10 (A and B show the same droplets)" in shown(capsys, "statistics", double)
    assert "show the same" not in shown(capsys, "statistics", results / "monday")


def test_people_read_what_is_doubtful_and_why_figures_are_missing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    said = {"exposures": json.dumps({"a": {"verdict": "doubtful", "reasons": ["it is blurred"]}})}
    shots = [in_box(shot) for shot in cone_shots(0, 5, 60, 29.0)]
    results = write_results(tmp_path / "blurred", shots, **said, spray=SPRAY)
    text = shown(capsys, "statistics", results)
    assert "5 of 5 exposures are doubtful, and count: it is blurred" in text
    assert "No cone angle: the box does not reach around the cone" in text
    assert "density of the liquid is not known" in text
    assert "No share of ghosts: " in text


def test_a_spray_without_a_figure_has_no_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = {"exposures": json.dumps({"a": {"verdict": "refused", "reasons": ["it is blurred"]}})}
    none = [stored_shot(np.empty(0), np.empty((0, 3)), np.empty((0, 3)), shot) for shot in range(2)]
    lines = shown(capsys, "statistics", write_results(tmp_path / "refused", none, **said)).splitlines()
    assert lines[1].startswith("2 of 2 exposures are refused, and do not count")


def test_quantiles_that_few_droplets_do_not_tell_have_a_reason(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    few = write_results(tmp_path / "few", cone_shots(0, 2, 6))
    assert "No Dv0.1, Dv0.5, Dv0.9, span: too few droplets" in shown(capsys, "statistics", few)


def test_options_say_where_the_nozzle_is(results: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    mute = write_results(tmp_path / "mute", cone_shots(0, 5, 120))
    assert told(capsys, "statistics", mute)["extent"] is None
    stated = told(capsys, "statistics", mute, "--nozzle", "0,0,0", "--axis", "0,2,0")
    by_run = told(capsys, "statistics", results / "monday")
    assert stated["extent"] == by_run["extent"]
    higher = told(capsys, "statistics", mute, "--nozzle", "0,-2,0")["extent"]["cone_angle_half_deg"]["value"]
    assert higher < by_run["extent"]["cone_angle_half_deg"]["value"]
    assert "--axis: where the nozzle is" in refused(capsys, "statistics", mute, "--axis", "0,1,0")
    assert "needs a nozzle and a direction" in refused(
        capsys, "statistics", mute, "--nozzle", "0,0,0", "--axis", "0,0,0"
    )


def test_a_comparison_finds_what_differs_and_says_what_was_measured_differently(
    results: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    again = write_results(tmp_path / "again", cone_shots(2, 5, 120), run="again", calibration="cal-2")
    compared = told(capsys, "statistics", results / "monday", again, results / "tuesday", "--compare")
    assert list(compared["runs"]) == ["monday", "again", "tuesday"]
    assert compared["measured_differently"] == ["again and monday differ in calibration: cal-2 and cal-1"]
    differing = {(one["first"], one["second"]) for one in compared["differences"] if one["significant"]}
    assert differing == {("monday", "tuesday"), ("again", "tuesday")}
    text = shown(capsys, "statistics", results / "monday", results / "tuesday", "--compare")
    assert text.count("whether all views still look where they did at the target") == 1
    compared_by_name = [line for line in text.splitlines() if line.startswith("tuesday / monday")]
    assert any("number density [1/mm³]" in line and "differs" in line for line in compared_by_name)
    assert text.strip().endswith("(Holm): below 0.05 a figure differs")


def test_a_comparison_in_which_nothing_differs_says_so(
    results: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    again = write_results(tmp_path / "again", cone_shots(2, 5, 120), run="again", calibration="cal-1")
    text = shown(capsys, "statistics", results / "monday", again, "--compare")
    assert text.strip().endswith("below 0.05 a figure differs; none does beyond chance")


def test_a_run_without_droplets_or_with_all_of_them_in_one_shot_is_told_beside_others(
    results: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    none = [stored_shot(np.empty(0), np.empty((0, 3)), np.empty((0, 3)), shot) for shot in range(5)]
    empty = write_results(tmp_path / "empty", none, run="empty", spray=SPRAY)
    once = write_results(tmp_path / "once", [*none[:4], *cone_shots(0, 5, 120)[4:]], run="once", spray=SPRAY)
    compared = told(capsys, "statistics", results / "monday", results / "tuesday", empty, once, "--compare")
    of_empty, of_once = compared["not_compared"]
    count = compared["runs"]["once"]["droplets"]["n"]
    assert of_empty == "empty: no figure of it is compared: none of its 5 exposures that count has a droplet"
    assert of_once.startswith(f"once: no figure of it is compared: all its {count} droplets are in one shot")
    assert compared["differences"]
    assert "5 times more or fewer droplets" in " ".join(compared["runs"]["once"]["doubts"])
    assert "empty: no figure of it is compared" in shown(capsys, "statistics", results / "monday", empty, "--compare")


def test_a_comparison_says_where_smaller_droplets_are_found_in_one_of_the_sprays(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Noise hides what is below 25 um in one of them: D10 differs by 4 %, and the sprays are the same."""
    names = {"clear": 13.0, "alike": 14.0, "noisy": 25.0}
    for seed, (name, from_um) in enumerate(names.items()):
        views = {f"view{number}": {"complete_from_um": from_um} for number in (1, 2)}
        told_of = json.dumps({"a": {"verdict": "good", "reasons": [], "views": views}})
        write_results(tmp_path / name, cone_shots(seed, 3, 60), run=name, exposures=told_of)
    compared = told(capsys, "statistics", *(tmp_path / name for name in names), "--compare")
    said = "\n".join(compared["measured_differently"])
    assert said.startswith("noisy and clear differ in the smallest droplets that are found: 25 and 13 um; smaller")
    assert "alike" not in said


def test_other_pressures_are_a_difference_of_the_sprays_not_of_the_measurement(
    results: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    low, high = (
        write_results(tmp_path / name, cone_shots(seed, 2, 30), run=name, notes=json.dumps({"pressure_bar": bar}))
        for seed, name, bar in ((1, "low", 6.0), (2, "high", 20.0))
    )
    compared = told(capsys, "statistics", low, high, "--compare")
    assert compared["measured_differently"] == []
    assert compared["conditions_differ"] == ["high and low are sprays of other conditions: pressure_bar: 20.0 and 6.0"]
    text = shown(capsys, "statistics", low, high, results / "monday", "--compare")
    assert "high and low are sprays of other conditions: pressure_bar: 20.0 and 6.0" in text
    assert "measured differently" not in text


def test_what_is_missing_for_one_reason_is_told_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    nowhere = write_results(tmp_path / "nowhere", cone_shots(0, 2, 60))
    (line,) = [line for line in shown(capsys, "statistics", nowhere).splitlines() if "nozzle and axis" in line]
    assert line.startswith("No extent, patternations: ")


def test_what_does_not_belong_together_is_refused_with_the_difference(
    results: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shots = cone_shots(2, 2, 30)
    calibration = write_results(tmp_path / "calibration", shots, run="b", calibration="cal-2", spray=SPRAY)
    text = refused(capsys, "statistics", results / "monday", calibration)
    assert "calibration cal-2" in text
    assert "with cal-1" in text
    assert "--compare" in text
    settings = json.dumps({"polarity": "shadow", "light": 0.8})
    recipe = write_results(tmp_path / "recipe", shots, run="c", settings=settings, spray=SPRAY)
    assert "measured with light 0.8" in refused(capsys, "statistics", results / "monday", recipe)
    moved = write_results(tmp_path / "moved", shots, run="d", spray='{"nozzle_mm": [1, 0, 0], "axis": [0, 1, 0]}')
    assert "measured with spray" in refused(capsys, "statistics", results / "monday", moved)
    (tmp_path / "empty").mkdir()
    assert "has no droplets" in refused(capsys, "statistics", tmp_path / "empty")
    assert "two directories at least" in refused(capsys, "statistics", results / "monday", "--compare")
    assert "would count as often" in refused(capsys, "statistics", results / "monday", results / "monday")


def test_a_distance_without_droplets_is_told_beside_one_that_has_some(
    results: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    one = told(capsys, "statistics", results / "monday", "--at", 9, "--at", 500)
    assert [slice["at_mm"] for slice in one["patternations"]] == [9]
    assert one["reasons"]["patternations"].startswith("500 mm from the nozzle: fewer than 20 droplets")


def test_a_density_in_another_unit_is_refused(results: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = refused(capsys, "statistics", results / "monday", "--liquid-density", 0.998)
    assert text == "--liquid-density: 0.998 kg/m3: liquids have 50 to 30000; water has 998"
