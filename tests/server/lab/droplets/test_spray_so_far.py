"""Statistics of a run while it grows: from a stated sample of its shots."""

from dataclasses import replace
from pathlib import Path

import pytest

from daq.run.events import RunStatus
from daq.run.state import RunState
from processing.runs.liquid.objects import NO_OBJECTS
from server.lab.droplets.measured import measured_run
from server.lab.droplets.proposed_separation import proposed_separation
from server.lab.droplets.spray_so_far import MOST_SHOTS, spray_so_far
from server.lab.errors import Damaged, NotFound
from server.lab.runs.run_store import RunStore
from server.rig.config import load_config
from server.web.ui.results.droplet_panel import droplet_row
from tests.support.droplet_run import write_run
from tests.support.sampled_sprays import cone_shots, write_results

SPRAY = '{"nozzle_mm": [0, 0, 0], "axis": [0, 1, 0]}'


def test_of_many_shots_an_even_sample_is_taken_and_told(tmp_path: Path) -> None:
    run_dir = write_run(tmp_path / "spray", shots=3)
    results_dir = write_results(run_dir / "results" / "droplets-1", cone_shots(0, 60, 30), spray=SPRAY)
    (results_dir / "settings.json").write_text("{}")
    runs = RunStore(tmp_path, lambda: RunStatus(state=RunState.IDLE))
    told = spray_so_far(runs, "spray", liquid_kg_m3=1000.0)
    assert (told.results, told.measured, told.recorded) == ("droplets-1", 60, 3)
    assert len(told.shots) == MOST_SHOTS
    assert (told.shots[0], told.shots[-1]) == (0, 59)
    assert told.statistics.droplets.shots == MOST_SHOTS
    assert told.statistics.motion
    assert told.statistics.motion.mass_flux_kg_m2_s
    assert told.statistics.motion.volume_flux_mm_s
    assert (told.liquid.ligaments, told.liquid.break_up_reason) == (0, NO_OBJECTS)
    flux = told.statistics.motion.volume_flux_mm_s.value
    assert told.statistics.motion.mass_flux_kg_m2_s.value == pytest.approx(flux)


def test_a_run_that_was_exchanged_is_told_although_its_droplets_are_what_they_were(tmp_path: Path) -> None:
    run_dir = write_run(tmp_path / "spray", shots=3)
    results_dir = write_results(run_dir / "results" / "droplets-1", cone_shots(0, 3, 40), run="spray")
    (results_dir / "settings.json").write_text("{}")
    runs = RunStore(tmp_path, lambda: RunStatus(state=RunState.IDLE))
    assert spray_so_far(runs, "spray").measured == 3
    assert len(measured_run(results_dir).shots) == 3
    other = write_run(tmp_path / "elsewhere" / "other", shots=3)
    (other / "run.h5").replace(run_dir / "run.h5")
    with pytest.raises(Damaged, match="holds droplets of run spray and lies in run other"):
        spray_so_far(runs, "spray")
    with pytest.raises(Damaged, match="holds droplets of run spray and lies in run other"):
        measured_run(results_dir)


def test_what_shots_say_together_and_nothing_checks_is_told_on_the_page(tmp_path: Path) -> None:
    """Each of two copies of a shot may be good; the calibration is gone, so that depth may be reversed for all."""
    run_dir = write_run(tmp_path / "spray", shots=2)
    (shot,) = cone_shots(0, 1, 40)
    copies = [replace(shot, provenance={**shot.provenance, "shot": number}) for number in (0, 1)]
    results_dir = write_results(run_dir / "results" / "droplets-1", copies, run="spray")
    (results_dir / "settings.json").write_text("{}")
    told = measured_run(results_dir)
    assert any("has the very droplets of" in doubt for doubt in told.doubts)
    row = droplet_row(told)
    assert "has the very droplets of" in row["verdict"]
    assert "whether grey values are in proportion to light" in row["not_checked"]
    assert "near and far would be exchanged" in row["not_checked"]


def test_droplets_of_another_run_of_the_same_name_are_told(tmp_path: Path) -> None:
    """Imports are called as their folders: those of two days have one name."""
    run_dir = write_run(tmp_path / "spray", shots=3, created_utc="2026-01-02T00:00:00+00:00")
    of = {"run": "spray", "run_created_utc": "2026-01-01T00:00:00+00:00"}
    results_dir = write_results(run_dir / "results" / "droplets-1", cone_shots(0, 3, 40), **of)
    (results_dir / "settings.json").write_text("{}")
    with pytest.raises(Damaged, match=r"run spray that began at 2026-01-01T.* another one, which began at 2026-01-02T"):
        measured_run(results_dir)


def test_a_separation_is_proposed_within_what_the_cameras_of_the_rig_accept(tmp_path: Path) -> None:
    run_dir = write_run(tmp_path / "spray", shots=3)
    runs = RunStore(tmp_path, lambda: RunStatus(state=RunState.IDLE))
    config = load_config(Path("configs/simulated.toml"))
    with pytest.raises(NotFound, match="measure some of its shots"):
        proposed_separation(runs, config, "spray")
    results_dir = write_results(run_dir / "results" / "droplets-1", cone_shots(0, 3, 40))
    (results_dir / "settings.json").write_text("{}")
    far, near = (proposed_separation(runs, config, "spray", voxels=voxels) for voxels in (5.0, 0.001))
    assert (far.results, far.shots, far.window_reason) == ("droplets-1", (0, 1, 2), None)
    assert far.proposal.separation_ns
    assert far.proposal.wanted_ns
    assert far.proposal.separation_ns == pytest.approx(far.proposal.wanted_ns.value, rel=0.01)
    assert far.window_ns
    assert near.proposal.separation_ns == far.window_ns[0]
    assert "cameras accept" in str(near.proposal.reason)
