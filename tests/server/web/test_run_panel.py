from dataclasses import replace

import pytest

from daq.causes import Cause, CauseCode
from daq.run.events import RunStatus
from daq.run.state import RunState
from daq.run_plan import LivePlan
from server.lab.duty import Health, Lamp
from server.web.ui.run.run_panel import acknowledge_text, counts_text, message_text, waits_for_acknowledgement


def generator_lamp(health: Health) -> Lamp:
    return Lamp(name="pulse generator", kind="generator", health=health, detail="")


@pytest.mark.parametrize(
    ("state", "generator", "waits"),
    [
        (RunState.IDLE, Health.OK, False),
        (RunState.IDLE, Health.FAULT, True),
        (RunState.ACQUIRING, Health.FAULT, False),
        (RunState.LIVE, Health.FAULT, False),
        (RunState.FAULT, Health.OK, True),
    ],
)
def test_a_fault_can_be_acknowledged_wherever_it_is_latched(state: RunState, generator: Health, waits: bool) -> None:
    door = Lamp(name="interlock", kind="interlock", health=Health.FAULT, detail="open")
    assert waits_for_acknowledgement(RunStatus(state=state), (door, generator_lamp(generator))) is waits


def test_of_two_causes_the_button_names_the_first_and_how_many_wait() -> None:
    causes = tuple(Cause(CauseCode.INTERLOCK_OPEN, text) for text in ("the door is open", "the generator was reset"))
    status = RunStatus(to_acknowledge=causes)
    assert waits_for_acknowledgement(status, ())
    assert acknowledge_text(status) == "Acknowledge 1 of 2: the door is open"
    assert acknowledge_text(RunStatus()) == "Acknowledge fault"


def test_invalid_shots_are_never_left_out() -> None:
    status = RunStatus(run_id="run", shots_planned=5, shots_recorded=4, shots_valid=3)
    assert counts_text(RunStatus()) == "", "that no run was yet says nothing of the rig"
    assert counts_text(status) == "4 / 5 shots recorded, 3 valid, 1 INVALID"


def test_counts_are_told_once() -> None:
    status = RunStatus(run_id="run", shots_planned=4, shots_recorded=4, shots_valid=4)
    assert message_text(replace(status, message=status.summary)) == ""
    ended = replace(status, live=LivePlan(), message="ended by the operator")
    assert message_text(ended) == "live view: ended by the operator", "the run was not"
    assert message_text(replace(ended, message=str(LivePlan()))).startswith("live view at 2 Hz")
    door = replace(status, message="the interlock is open", causes=(Cause(CauseCode.INTERLOCK_OPEN, "a door"),))
    assert message_text(door) == "live view: the interlock is open", "the run before it had been completed"
    assert message_text(replace(door, ended_run="run")) == "the interlock is open"
    assert message_text(replace(status, message="shot 3 is fired again")) == "shot 3 is fired again"
