"""The state of the rig in one word, and how long a run still takes."""

import pytest

from daq.run.events import RunStatus
from daq.run.refusals import RefusalCode
from daq.run.state import RunState
from daq.run_plan import PulsePair, RunPlan
from server.lab.desk.desk_watch import DeskWatch
from server.lab.desk.pace import Pace
from server.lab.desk.reason import UNSEEN, Reason
from server.lab.desk.rig_state import RigWord, rig_state

DOOR = Reason(code=RefusalCode.INTERLOCK_OPEN, text="door: the interlock is open", remedy="close the door")
BUSY = Reason(code=RefusalCode.BUSY, text="a run is under way", remedy="wait for its end, or stop it")
PLAN = RunPlan(name="spray", shots=266, rate_hz=2.0, pulse=PulsePair(current_a={"view1": 5.0}))


def acquiring(recorded: int) -> RunStatus:
    return RunStatus(
        state=RunState.ACQUIRING, run_id="one", shots_planned=PLAN.shots, shots_recorded=recorded, plan=PLAN
    )


@pytest.mark.parametrize("state", RunState)
def test_only_a_rig_at_rest_without_a_reason_is_ready(state: RunState) -> None:
    for reasons in ((), (DOOR,)):
        word = rig_state(RunStatus(state=state), reasons).state
        assert (word is RigWord.READY) == (state is RunState.IDLE and reasons == ())
        assert word.value == state.value or state is RunState.IDLE


def test_the_text_says_what_belongs_to_the_state() -> None:
    assert rig_state(RunStatus(), (DOOR,)).text == "NOT READY: door: the interlock is open"
    assert rig_state(acquiring(12), (), 127.4).text == "ACQUIRING 12/266, 2:07 left"
    assert rig_state(acquiring(12), (), 3600.0 + 61).text == "ACQUIRING 12/266, 1:01:01 left"


def test_a_run_takes_as_long_as_its_shots_do_and_before_the_first_one_as_planned() -> None:
    now_s = [100.0]
    pace = Pace(lambda: now_s[0])
    assert pace.eta_s(RunStatus()) is None
    assert pace.eta_s(acquiring(0)) == 133.0
    now_s[0] += 10
    assert pace.eta_s(acquiring(10)) == 256.0
    now_s[0] += 0.5
    assert pace.eta_s(acquiring(10)) == 255.5
    assert pace.eta_s(RunStatus(state=RunState.DISARMING)) is None


def test_a_shot_that_is_late_takes_no_time_from_those_that_are_still_to_come() -> None:
    now_s = [100.0]
    pace = Pace(lambda: now_s[0])
    assert pace.eta_s(acquiring(0)) == 133.0
    now_s[0] += 100
    assert pace.eta_s(acquiring(0)) == 132.5
    assert pace.eta_s(acquiring(10)) == 2560.0
    now_s[0] += 1000
    assert pace.eta_s(acquiring(10)) == 2550.0


def test_a_rig_that_nobody_has_looked_at_for_seconds_is_not_ready() -> None:
    now_s = [0.0]
    watch = DeskWatch(RunStatus, tuple, now_s=lambda: now_s[0])
    assert watch.state.state is RigWord.NOT_READY
    assert watch.look().state is RigWord.READY
    now_s[0] = 3.1
    assert watch.state.state is RigWord.NOT_READY
    assert watch.state.reasons == (UNSEEN,)


@pytest.mark.parametrize("before", [state for state in RunState if state is not RunState.IDLE])
def test_what_was_found_before_a_run_or_a_live_view_ended_is_told_no_more(before: RunState) -> None:
    doing = [before]
    found: list[tuple[Reason, ...]] = [(BUSY,)]
    watch = DeskWatch(lambda: RunStatus(state=doing[0]), lambda: found[0])
    assert watch.look().reasons == (BUSY,)
    doing[0] = RunState.IDLE
    assert (watch.state.text, watch.state.reasons) == ("NOT READY: the rig is being looked at", (UNSEEN,))
    found[0] = ()
    assert watch.look().state is RigWord.READY


def test_what_was_found_while_a_run_ended_is_told_no_more() -> None:
    doing = [RunState.ARMING]

    def look() -> tuple[Reason, ...]:
        doing[0] = RunState.IDLE
        return ()

    watch = DeskWatch(lambda: RunStatus(state=doing[0]), look)
    assert watch.look().state is RigWord.NOT_READY
    assert watch.look().state is RigWord.READY
