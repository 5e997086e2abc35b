"""Conditions that an operator mends after a run: what is measured uses them, and says who changed what."""

from pathlib import Path

import pytest

from daq.files.run_directory import RunNotes, RunReader, Spray, add_change
from processing.analysis.droplets.droplet_file import DropletFileError
from processing.analysis.spray.spray_axis import SprayAxis
from processing.runs.liquid.objects import nozzle_of
from processing.runs.sprays.conditions import conditions_of
from processing.runs.sprays.measured_spray import read_spray
from tests.support.droplet_run import write_run
from tests.support.sampled_sprays import cone_shots, write_results

RECORDED, MENDED = Spray(nozzle_mm=(0, 0, 0)), Spray(nozzle_mm=(0, -5, 0.5))
WATER, ETHANOL = RunNotes(fluid="water"), RunNotes(fluid="ethanol")


def mend(run_dir: Path, notes: RunNotes = WATER, spray: Spray | None = None) -> str:
    add_change(run_dir, RunReader(run_dir).header, notes, "ann@lab", spray)
    return RunReader(run_dir).notes_changes[-1].at_utc


def measured(run_dir: Path, name: str = "droplets-1", first: int = 0) -> Path:
    """As measure writes it, of two shots."""
    shots = cone_shots(0, 4, 10)[first : first + 2]
    return write_results(run_dir / "results" / name, shots, run="run", **conditions_of(RunReader(run_dir)))


@pytest.fixture
def run_dir(tmp_path: Path) -> Path:
    return write_run(tmp_path / "run", notes=WATER, spray=RECORDED)


def test_what_was_mended_before_it_was_measured_is_used_and_said_in_the_file(run_dir: Path) -> None:
    at_utc = mend(run_dir, ETHANOL, MENDED)
    nozzle = nozzle_of(RunReader(run_dir), None)
    assert nozzle is not None
    assert nozzle.point_mm == MENDED.nozzle_mm
    spray = read_spray([measured(run_dir)])
    assert spray.axis == SprayAxis(MENDED.nozzle_mm, MENDED.axis)
    assert spray.changes == (
        f"run run was changed by ann@lab at {at_utc}, after it was recorded: nozzle_mm is (0, -5, 0.5), recorded: "
        "(0, 0, 0); fluid is ethanol, recorded: water",
    )


def test_what_is_mended_after_it_was_measured_is_told_and_changes_no_number(run_dir: Path) -> None:
    results = measured(run_dir)
    assert read_spray([results]).changes == ()
    mend(run_dir, ETHANOL)
    (told,) = read_spray([results]).changes
    assert "after it was measured: fluid is ethanol, measured with: water" in told
    assert "measure it again" not in told
    mend(run_dir, ETHANOL, MENDED)
    spray = read_spray([results])
    assert spray.axis == SprayAxis(RECORDED.nozzle_mm, RECORDED.axis)
    assert "nozzle_mm is (0, -5, 0.5), measured with: (0, 0, 0)" in spray.changes[0]
    assert spray.changes[0].endswith("measure it again")


def test_a_nozzle_that_is_stated_only_afterwards_is_that_of_the_spray(tmp_path: Path) -> None:
    run_dir = write_run(tmp_path / "run", notes=WATER)
    results = measured(run_dir)
    assert read_spray([results]).axis is None
    mend(run_dir, WATER, MENDED)
    spray = read_spray([results])
    assert spray.axis == SprayAxis(MENDED.nozzle_mm, MENDED.axis)
    assert "nozzle_mm is (0, -5, 0.5), measured with: not stated" in spray.changes[0]


def test_shots_of_before_and_after_are_not_pooled_and_the_remedy_is_named(run_dir: Path) -> None:
    results = measured(run_dir)
    mend(run_dir, WATER, MENDED)
    again = measured(run_dir, "droplets-2", first=2)
    with pytest.raises(DropletFileError, match="before nozzle or axis were mended are measured again"):
        read_spray([results, again])


def test_later_conditions_that_are_damaged_are_told_beside_good_droplets(run_dir: Path) -> None:
    results = measured(run_dir)
    mend(run_dir, ETHANOL, MENDED)
    (run_dir / "notes.json").write_text("{}")
    spray = read_spray([results])
    assert spray.axis == SprayAxis(RECORDED.nozzle_mm, RECORDED.axis)
    assert "whether run run was changed later is not known: " in spray.changes[0]


def test_nozzle_and_axis_stay_where_only_notes_are_changed_and_the_same_ones_are_no_change(run_dir: Path) -> None:
    add_change(run_dir, RunReader(run_dir).header, WATER, "ann@lab", RECORDED)
    assert RunReader(run_dir).conditions.changed is None
    mend(run_dir, WATER, MENDED)
    mend(run_dir, ETHANOL)
    now = RunReader(run_dir).conditions
    assert (now.notes, now.spray) == (ETHANOL, MENDED)
