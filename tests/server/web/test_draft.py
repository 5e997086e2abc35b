from pathlib import Path

import pytest

from daq.run_plan import RunKind
from server.web.ui.draft import (
    PLAN_FIELDS,
    PULSE_FIELDS,
    DraftStore,
    plan_of,
    positions,
    problem_of,
    problem_of_current,
    problem_of_positions,
)
from tests.support.memory_rig import memory_config


def test_a_draft_outlives_the_server(tmp_path: Path) -> None:
    config = memory_config(tmp_path / "runs")
    DraftStore(tmp_path / "draft.json", config).set("shots", 77)
    assert DraftStore(tmp_path / "draft.json", config).values["shots"] == 77


def test_the_first_draft_is_a_plan_for_this_rig(tmp_path: Path) -> None:
    config = memory_config(tmp_path / "runs")
    plan = plan_of(DraftStore(tmp_path / "draft.json", config).values)
    assert plan.pulse.current_a == {"view1": 10.0, "view2": 10.0}
    assert plan.stage_z_mm == ()


def test_only_a_calibration_run_moves_the_target_and_only_a_sample_run_has_references(tmp_path: Path) -> None:
    values = DraftStore(tmp_path / "draft.json", memory_config(tmp_path / "runs")).values
    values |= {"references": ["dark-1"], "calibration": "paper"}
    calibration = plan_of(values | {"kind": "calibration"})
    assert (calibration.kind, calibration.references, calibration.calibration) == (RunKind.CALIBRATION, (), None)
    assert calibration.stage_z_mm == (-4, -2, 0, 2, 4)
    assert plan_of(values).references == ("dark-1",)


@pytest.mark.parametrize(
    ("name", "value", "problem"),
    [
        ("shots", 0, "greater than or equal to 1"),
        ("shots", None, "a valid integer"),
        ("shots", 10.0, None),
        ("rate_hz", 0, "greater than 0"),
        ("rate_hz", 2, None),
    ],
)
def test_the_limits_of_a_field_are_those_of_the_plan(name: str, value: object, problem: str | None) -> None:
    assert problem_of(PLAN_FIELDS, name, value) == problem


def test_the_limits_of_the_pulse_and_of_the_light_are_checked_too() -> None:
    assert problem_of(PULSE_FIELDS, "width_ns", 100) == "greater than or equal to 250"
    assert problem_of_current(13, 12) == "0 to 12 A"
    assert problem_of_current(None, 12) == "0 to 12 A"
    assert problem_of_current(0, 12) is None


def test_positions_are_read_from_a_list() -> None:
    assert positions(" -4, 0,2.5 ,") == (-4.0, 0.0, 2.5)
    assert problem_of_positions("1, two") is not None
    assert problem_of_positions(None) is None
