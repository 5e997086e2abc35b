"""Where the nozzle of a run is, and what the files of its shots say of break-up."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from daq.files.run_directory import RunReader
from daq.run_notes import Spray
from processing.analysis.droplets.droplet_file import StoredDroplets
from processing.analysis.objects.break_up import THRESHOLDS, Nozzle, Reach
from processing.analysis.objects.liquid_objects import LiquidObjects
from processing.runs.liquid.objects import NO_OBJECTS, liquid_summary, nozzle_of, place_and_axis
from tests.support.droplet_run import write_run

COLUMNS = tuple(LiquidObjects.none().columns())


def test_the_nozzle_is_that_of_the_run_unless_another_is_stated(tmp_path: Path) -> None:
    spray = Spray(nozzle_mm=(1.0, -2.0, 3.0), axis=(0.0, 2.0, 1.0))
    with RunReader(write_run(tmp_path / "told", spray=spray)) as run:
        assert nozzle_of(run, None) == Nozzle((1.0, -2.0, 3.0), (0.0, 2.0, 1.0))
        assert nozzle_of(run, (0.0, -8.0, 0.0)) == Nozzle((0.0, -8.0, 0.0))
        assert nozzle_of(run, (0.0, -8.0, 0.0, 1.0, 1.0, 0.0)) == Nozzle((0.0, -8.0, 0.0), (1.0, 1.0, 0.0))
    with RunReader(write_run(tmp_path / "untold")) as run:
        assert nozzle_of(run, None) is None


@pytest.mark.parametrize("numbers", [(), (0.0, 1.0), (0.0,) * 4, (0.0,) * 6, (0.0, float("nan"), 0.0)])
def test_numbers_that_are_no_nozzle_are_refused(numbers: tuple[float, ...]) -> None:
    with pytest.raises(ValueError, match="x, y, z of the orifice"):
        place_and_axis(numbers)


def _shot(*reaches: Reach) -> StoredDroplets:
    """Two ligaments and a sheet in each exposure."""
    exposures: dict[str, Any] = {
        frame: {"objects": {"reach": asdict(reach)}} for frame, reach in zip("ab", reaches, strict=False)
    }
    objects = {name: np.tile((0.4, 0.6, 2.0), len(reaches)) for name in COLUMNS}
    objects["class"] = np.tile(["ligament", "ligament", "sheet"], len(reaches))
    return StoredDroplets({"frame": np.empty(0, "U1")}, {"exposures": json.dumps(exposures)}, objects)


def _reach(length_mm: float, leaves: bool = False) -> Reach:
    return Reach(THRESHOLDS, (length_mm,) * 4, (leaves,) * 4, 0.01)


def test_the_first_exposure_of_each_shot_counts() -> None:
    found = liquid_summary([_shot(_reach(length_mm), _reach(9.0)) for length_mm in (4.0, 5.0, 6.0)])
    assert found.break_up_mm is not None
    assert found.break_up_mm.value == 5.0
    assert (found.ligaments, found.sheets, found.clusters) == (12, 6, 0)
    assert found.ligament_medians
    assert found.ligament_medians.length_mm.value == pytest.approx(0.5)
    assert found.ligament_medians.length_mm.low < 0.5 < found.ligament_medians.length_mm.high
    assert liquid_summary([_shot(_reach(4.0))]).ligament_medians is None


def test_what_is_not_known_is_null_with_its_reason() -> None:
    leaving = liquid_summary([_shot(_reach(6.0, leaves=True))])
    assert (leaving.break_up_mm, leaving.break_up_longer_than_mm) == (None, 6.0)
    assert liquid_summary([_shot(Reach(reason="no nozzle"))]).break_up_reason == "no nozzle"
    old = StoredDroplets({"frame": np.empty(0, "U1")}, {"exposures": json.dumps({"a": {"verdict": "good"}})})
    assert liquid_summary([old]).break_up_reason == NO_OBJECTS


@pytest.mark.parametrize(
    ("verdicts", "reason"),
    [
        ("empty", "exposures are empty: no view sees any liquid"),
        ("refused", "exposures are refused"),
        ("empty refused", "exposures are empty: no view sees any liquid or exposures are refused"),
        ("empty good", NO_OBJECTS),
        ("", NO_OBJECTS),
    ],
)
def test_a_length_of_nothing_is_not_said_to_be_unasked(verdicts: str, reason: str) -> None:
    told = [{"exposures": json.dumps({"a": {"verdict": verdict}})} for verdict in verdicts.split()]
    shots = [StoredDroplets({"frame": np.empty(0, "U1")}, {**one}) for one in told]
    assert liquid_summary(shots).break_up_reason == reason
