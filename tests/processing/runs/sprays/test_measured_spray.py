"""Results as sprays: where the nozzle is, by the files, or by the run that they lie in."""

import json
from pathlib import Path

import pytest

from daq.files.run_directory import RunNotes, RunReader, Spray
from processing.analysis.spray.spray_axis import SprayAxis
from processing.runs.sprays.conditions import conditions_of
from processing.runs.sprays.measured_spray import read_compared, read_spray
from tests.support.droplet_run import write_run
from tests.support.sampled_sprays import cone_shots, write_results

SPRAY = Spray(nozzle_mm=(1, 2, 3), axis=(0, 0, 1))


def test_what_the_operator_wrote_travels_with_what_is_measured(tmp_path: Path) -> None:
    noted = write_run(tmp_path / "noted", spray=SPRAY, notes=RunNotes(fluid="water", pressure_bar=6.0))
    with RunReader(noted) as run, RunReader(write_run(tmp_path / "bare")) as bare:
        said = conditions_of(run)
        assert conditions_of(bare) == {}
    assert Spray.model_validate_json(said["spray"]) == SPRAY
    assert RunNotes.model_validate_json(said["notes"]) == RunNotes(fluid="water", pressure_bar=6.0)
    results = write_results(tmp_path / "results", cone_shots(0, 2, 10), **said)
    assert read_spray([results]).axis == SprayAxis((1, 2, 3), (0, 0, 1))


def test_older_results_have_the_nozzle_of_the_run_that_they_lie_in(tmp_path: Path) -> None:
    run_dir = write_run(tmp_path / "run", spray=SPRAY)
    results = write_results(run_dir / "results" / "droplets-1", cone_shots(0, 2, 10), run="run")
    spray = read_spray([results])
    assert (spray.axis, spray.name) == (SprayAxis((1, 2, 3), (0, 0, 1)), "run/droplets-1")
    (run_dir / "run.h5").write_bytes(b"damaged")
    assert read_spray([results]).axis is None
    elsewhere = write_results(tmp_path / "elsewhere", cone_shots(0, 2, 10))
    assert read_spray([elsewhere]).axis is None


@pytest.mark.parametrize("direction", [(0, 0, 0), (0, float("nan"), 1)])
def test_an_axis_leads_somewhere(direction: tuple[float, float, float]) -> None:
    with pytest.raises(ValueError, match="a spray needs a nozzle and a direction"):
        SprayAxis((0, 0, 0), direction)


def test_shots_beside_folders_of_shots_are_all_read(tmp_path: Path) -> None:
    write_results(tmp_path / "all", cone_shots(0, 2, 10), run="monday")
    write_results(tmp_path / "all" / "tuesday", cone_shots(1, 3, 10), run="tuesday")
    assert len(read_spray([tmp_path / "all"]).shots) == 5


def test_results_right_below_the_root_are_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    results = write_results(tmp_path / "out", cone_shots(0, 2, 10))
    monkeypatch.setattr(Path, "resolve", lambda path: Path("/", *path.parts[-2:]))
    assert read_spray([results]).axis is None


def test_shots_that_are_in_both_of_two_sprays_are_told(tmp_path: Path) -> None:
    shots = cone_shots(0, 3, 20)
    monday = write_results(tmp_path / "monday", shots, run="monday")
    copied = write_results(tmp_path / "copied", shots[:2], run="another")
    again = write_results(tmp_path / "again", cone_shots(1, 2, 20), run="monday")
    other = write_results(tmp_path / "other", cone_shots(2, 2, 20), run="other")
    assert read_compared([monday, other]).unlike == ()
    for two in (copied, again):
        (told,) = read_compared([monday, two]).unlike
        assert f"{two.name} and monday have 2 shots in common" in told


def test_what_operators_state_of_sprays_that_are_compared_is_told(tmp_path: Path) -> None:
    notes = [RunNotes(operator=who, fluid=fluid, nozzle=name) for who, fluid, name in (
        ("Ada", "water", "A4"), ("Bo", "ethanol", "A5"), ("Ada", "water", "A4")
    )]  # fmt: skip
    separations = [{"separation_ns": ns, "separation_source": "stated"} for ns in (6400.0, 3200.0, 6400.0001)]
    results = [
        write_results(
            tmp_path / name,
            cone_shots(number, 2, 20),
            run=name,
            notes=notes[number].model_dump_json(exclude_defaults=True),
            velocity=json.dumps(separations[number]),
        )
        for number, name in enumerate(("one", "two", "like"))
    ]
    alike, other = read_compared([results[0], results[2]]), read_compared(results[:2])
    assert (alike.conditions, alike.unlike) == ((), ())
    assert other.conditions == (
        "two and one are sprays of other conditions: fluid: ethanol and water; nozzle: A5 and A4",
    )
    assert other.unlike == ("two and one differ in separation: 3.2 us as stated and 6.4 us as stated",)
    mute = write_results(tmp_path / "mute", cone_shots(3, 2, 20), run="mute")
    (told,) = read_compared([results[0], mute]).conditions
    assert told.startswith("mute and one are sprays of other conditions: fluid: not stated and water; ")


def test_nozzles_at_two_places_are_told_where_sprays_are_compared(tmp_path: Path) -> None:
    one = write_results(
        tmp_path / "one", cone_shots(0, 2, 20), run="one", spray='{"nozzle_mm": [0, 0, 0], "axis": [0, 1, 0]}'
    )
    two = write_results(
        tmp_path / "two", cone_shots(1, 2, 20), run="two", spray='{"nozzle_mm": [0, 2, 0], "axis": [0, 1, 0]}'
    )
    (told,) = read_compared([one, two]).unlike
    assert "two and one differ in nozzle and axis" in told
    assert "(0, 2, 0) mm along (0, 1, 0)" in told


def test_boxes_in_which_sprays_were_measured_are_told_where_they_are_compared(tmp_path: Path) -> None:
    """Densities and flux are means over the box: of one spray they differ where boxes do."""
    one = write_results(tmp_path / "one", cone_shots(0, 2, 20), run="one")
    grid = json.loads(str(cone_shots(0, 1, 20)[0].provenance["grid"]))
    smaller = json.dumps({**grid, "shape": [50, 40, 100]})
    two = write_results(tmp_path / "two", cone_shots(1, 2, 20), run="two", grid=smaller)
    assert read_compared([one, two]).unlike == (
        "two and one differ in box: x -5 to 5, y 8 to 12, z -5 to 0 mm and x -5 to 5, y 8 to 12, z -5 to 5 mm",
    )
