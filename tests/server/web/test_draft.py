from pathlib import Path

import pytest

from daq.run_plan import RunKind
from server.lab.events import EventPublisher
from server.web.ui.draft import (
    PLAN_FIELDS,
    PULSE_FIELDS,
    DraftStore,
    first_draft,
    limits_of,
    plan_of,
    positions,
    problem_of,
    problem_of_current,
    problem_of_positions,
)
from tests.support.memory_rig import memory_config


def test_a_draft_outlives_the_server(tmp_path: Path) -> None:
    config = memory_config(tmp_path / "runs")
    DraftStore(tmp_path / "draft.json", config, EventPublisher()).set("shots", 77)
    assert DraftStore(tmp_path / "draft.json", config, EventPublisher()).values["shots"] == 77


def test_what_the_disk_refuses_stays_in_the_form_and_is_kept_with_the_next_change(tmp_path: Path) -> None:
    config, path = memory_config(tmp_path / "runs"), tmp_path / "away" / "draft.json"
    draft = DraftStore(path, config, EventPublisher())
    draft.set("shots", 77)
    assert draft.values["shots"] == 77
    path.parent.mkdir()
    draft.set("fluid", "water")
    again = DraftStore(path, config, EventPublisher()).values
    assert (again["shots"], again["fluid"]) == (77, "water")


@pytest.mark.parametrize("text", ['{"shots": 7', "[]", '{"kind": "party"}', '{"current_a": 3}', "\x00\x01", ""])
def test_a_torn_draft_is_kept_aside_and_the_first_one_is_shown(tmp_path: Path, text: str) -> None:
    config, events, path = memory_config(tmp_path / "runs"), EventPublisher(), tmp_path / "draft.json"
    path.write_text(text)
    assert DraftStore(path, config, events).values == first_draft(config)
    (aside,) = tmp_path.glob("draft.json.damaged-*")
    assert aside.read_text() == text
    (event,) = events.since(0)
    assert aside.name in event.data["reason"]


def test_references_of_an_older_draft_are_taken_for_chosen(tmp_path: Path) -> None:
    config, path = memory_config(tmp_path / "runs"), tmp_path / "draft.json"
    path.write_text('{"references": ["dark-1"]}')
    assert DraftStore(path, config, EventPublisher()).values["are_references_chosen"] is True
    path.write_text('{"references": []}')
    assert DraftStore(path, config, EventPublisher()).values["are_references_chosen"] is False


def test_the_first_draft_is_a_plan_for_this_rig(tmp_path: Path) -> None:
    config = memory_config(tmp_path / "runs")
    plan = plan_of(DraftStore(tmp_path / "draft.json", config, EventPublisher()).values)
    assert plan.pulse.current_a == {"view1": 10.0, "view2": 10.0}
    assert plan.stage_z_mm == ()


def test_name_and_shots_that_nobody_chose_follow_the_kind_of_the_run(tmp_path: Path) -> None:
    draft = DraftStore(tmp_path / "draft.json", memory_config(tmp_path / "runs"), EventPublisher())
    usual = (
        ("dark", "dark", 10),
        ("calibration", "target", 1),
        ("background", "background", 20),
        ("sample", "spray", 10),
    )
    for kind, name, shots in usual:
        draft.set("kind", kind)
        assert (draft.values["name"], draft.values["shots"]) == (name, shots)
    draft.set("name", "nozzle 3")
    draft.set("shots", 7)
    draft.set("kind", "background")
    assert (draft.values["name"], draft.values["shots"]) == ("nozzle 3", 7)


def test_only_a_calibration_run_moves_the_target_and_only_a_sample_run_has_references(tmp_path: Path) -> None:
    values = DraftStore(tmp_path / "draft.json", memory_config(tmp_path / "runs"), EventPublisher()).values
    values |= {"references": ["dark-1"], "calibration": "paper"}
    calibration = plan_of(values | {"kind": "calibration"})
    assert (calibration.kind, calibration.references, calibration.calibration) == (RunKind.CALIBRATION, (), None)
    assert calibration.stage_z_mm == (-4, -2, 0, 2, 4)
    assert plan_of(values).references == ("dark-1",)


def test_a_target_is_moved_somewhere_where_there_is_a_stage_and_nowhere_else(tmp_path: Path) -> None:
    config, path = memory_config(tmp_path / "runs"), tmp_path / "draft.json"
    moved = DraftStore(path, config, EventPublisher())
    moved.set("kind", "calibration")
    assert DraftStore(path, config, EventPublisher(), has_stage=False).plan.stage_z_mm == ()
    moved.set("stage_z_mm", " ")
    with pytest.raises(ValueError, match="stage_z_mm"):
        _ = moved.plan


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
    assert problem_of_positions("-4, 0,2.5 ,") is None


@pytest.mark.parametrize("text", [None, "", " , "])
def test_a_calibration_run_without_positions_could_not_be_calibrated(text: str | None) -> None:
    assert problem_of_positions(text) == "numbers in mm, separated by commas"


def test_a_page_does_not_undo_what_another_one_has_changed(tmp_path: Path) -> None:
    config, path = memory_config(tmp_path / "runs"), tmp_path / "draft.json"
    first, second = DraftStore(path, config, EventPublisher()), DraftStore(path, config, EventPublisher())
    first.set("shots", 77)
    second.set("name", "fan")
    kept = DraftStore(path, config, EventPublisher()).values
    assert (kept["shots"], kept["name"]) == (77, "fan")


def test_what_the_page_shows_is_adopted_and_a_number_that_is_none_is_left_empty(tmp_path: Path) -> None:
    draft = DraftStore(tmp_path / "draft.json", memory_config(tmp_path / "runs"), EventPublisher())
    draft.adopt({"name": "late words", "rate_hz": "3.5", "current_a:view2": "4", "shots": "", "width_ns": "1000"})
    values = draft.values
    assert (values["name"], values["rate_hz"], values["shots"], values["width_ns"]) == ("late words", 3.5, None, 1000)
    assert values["current_a"] == {"view1": 10.0, "view2": 4.0}


def test_a_draft_of_another_rig_gives_this_one_no_views(tmp_path: Path) -> None:
    config, path = memory_config(tmp_path / "runs"), tmp_path / "draft.json"
    path.write_text('{"current_a": {"view1": 3, "top": 9}}')
    assert DraftStore(path, config, EventPublisher()).values["current_a"] == {"view1": 3, "view2": 10.0}


def test_other_tabs_see_that_something_was_changed(tmp_path: Path) -> None:
    draft = DraftStore(tmp_path / "draft.json", memory_config(tmp_path / "runs"), EventPublisher())
    before = draft.version
    draft.set("shots", 5)
    assert draft.version > before


def test_limits_are_those_of_the_plan() -> None:
    assert limits_of(PLAN_FIELDS, "shots") == "1 to 100000"
    assert limits_of(PLAN_FIELDS, "rate_hz") == "above 0 to 100"
    assert limits_of(PULSE_FIELDS, "width_ns") == "250 to 2000"


def test_what_no_device_knows_is_part_of_the_plan(tmp_path: Path) -> None:
    values = DraftStore(tmp_path / "draft.json", memory_config(tmp_path / "runs"), EventPublisher()).values
    notes = plan_of(values | {"operator": "ann", "fluid": None, "pressure_bar": 40}).notes
    assert (notes.operator, notes.fluid, notes.pressure_bar) == ("ann", "", 40)


def test_whoever_may_not_change_the_form_changes_nothing_by_any_door(tmp_path: Path) -> None:
    config, path = memory_config(tmp_path / "runs"), tmp_path / "draft.json"
    draft = DraftStore(path, config, EventPublisher(), may_change=lambda: False)
    draft.set("shots", 77)
    draft.adopt({"rate_hz": "9", "current_a:view1": "12"})
    assert (draft.values, draft.version) == (first_draft(config), 0)
    assert not path.exists()


def test_a_damaged_draft_that_cannot_be_set_aside_is_told_and_stops_nobody(tmp_path: Path) -> None:
    config, events = memory_config(tmp_path / "runs"), EventPublisher()
    path = tmp_path / ("d" * 240)  # with more to its name no disk takes it; so does one that is read-only
    path.write_text('{"shots": ')
    assert DraftStore(path, config, events).values == first_draft(config)
    (told,) = events.since(0)
    assert told.name == "file_damaged"
    assert "it cannot be set aside" in str(told.data["reason"])
    assert path.is_file()
