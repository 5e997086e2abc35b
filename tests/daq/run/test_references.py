"""Dark and background images are those of cameras that were told the same."""

from pathlib import Path
from typing import Any

import pytest

from daq.errors import PlanError
from daq.run.acquisition import Acquisition
from daq.run.references import told_otherwise
from daq.run_plan import RunKind
from tests.daq.run.test_acquisition import DEADLINE_S, plan_of
from tests.support.memory_rig import MemoryRig


def told(gain: object, exposure_b_ns: int = 30_000_000, first: str = "TriggerMode") -> dict[str, Any]:
    """Configuration of a rig whose view1 is told a gain; None: from before runs kept what cameras are told."""
    values = {"Gain": gain, "TriggerMode": "On"}
    features = [{"feature": name, "value": values[name]} for name in sorted(values, key=lambda name: name != first)]
    profile = {"features": features, "timing": {"exposure_b_ns": exposure_b_ns, "guard_ns": 200}}
    return {} if gain is None else {"camera_profiles": {"view1": profile}}


@pytest.mark.parametrize(
    ("now", "difference"),
    [
        (told(2.0), "view1 Gain = 1.0 then, view1 Gain = 2.0 now"),
        (told(1.0, 60_000_000), "view1 exposure_b_ns = 30000000 then, view1 exposure_b_ns = 60000000 now"),
    ],
)
def test_what_a_camera_is_told_otherwise_is_named_with_both_values(now: dict[str, Any], difference: str) -> None:
    assert told_otherwise(told(1.0), now) == difference


@pytest.mark.parametrize("now", [told(1.0), told(None), told(1.0, first="Gain"), told(1)])
def test_what_is_the_same_or_not_known_is_no_difference(now: dict[str, Any]) -> None:
    """A gain of 1 is one of 1.0, however its profile writes it."""
    assert told_otherwise(told(1.0), now) == ""


def test_a_reference_for_which_a_camera_was_told_otherwise_is_refused_before_a_run_begins(tmp_path: Path) -> None:
    rig = MemoryRig().rig
    with Acquisition(rig, tmp_path, configuration=told(1.0)) as acquisition:
        dark = acquisition.start(plan_of(1, kind=RunKind.DARK))
        assert not acquisition.wait(DEADLINE_S).active
    refused = ""
    with Acquisition(rig, tmp_path, configuration=told(2.0)) as acquisition:
        try:
            acquisition.start(plan_of(1, references=(dark,)))
        except PlanError as error:
            refused = str(error)
    assert refused == (
        f"references: for '{dark}' cameras were told otherwise than they are now: "
        "view1 Gain = 1.0 then, view1 Gain = 2.0 now"
    )
    assert [path.name for path in tmp_path.iterdir()] == [dark]
