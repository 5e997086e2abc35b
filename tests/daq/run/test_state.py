"""Properties of the transition table, over every path."""

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from daq.errors import BusyError
from daq.run.state import OUTCOMES, TRANSITIONS, RunOutcome, RunState, RunStep, next_state

LIGHT_MAY_BE_ON = {RunState.ARMING, RunState.ACQUIRING, RunState.LIVE}
IN_A_RUN = {RunState.ARMING, RunState.ACQUIRING}
CONFIRMATIONS = {RunStep.LIGHT_OFF, RunStep.LIGHT_UNKNOWN}
RESTING = {RunState.IDLE, RunState.FAULT}


def walk(steps: list[RunStep]) -> list[tuple[RunStep, RunState]]:
    """Path from IDLE; steps that are not permitted are refused and leave the state as it is."""
    state, path = RunState.IDLE, []
    for step in steps:
        try:
            state = next_state(state, step)
        except BusyError:
            continue
        path.append((step, state))
    return path


paths = st.lists(st.sampled_from(RunStep), max_size=60).map(walk)


@given(paths)
def test_light_is_accounted_for_before_a_run_is_over(path: list[tuple[RunStep, RunState]]) -> None:
    for (_, before), (step, after) in itertools.pairwise(path):
        if before in IN_A_RUN:
            assert after in IN_A_RUN | {RunState.DISARMING}
        if before is RunState.LIVE:
            assert step in CONFIRMATIONS
        if after in RESTING and before not in RESTING:
            assert before in {RunState.DISARMING, RunState.LIVE}
            assert step in CONFIRMATIONS


@given(paths)
def test_nothing_but_a_start_from_rest_brings_light(path: list[tuple[RunStep, RunState]]) -> None:
    for (_, before), (step, after) in itertools.pairwise(path):
        if after in LIGHT_MAY_BE_ON and before not in LIGHT_MAY_BE_ON:
            assert (before, step) in {(RunState.IDLE, RunStep.START), (RunState.IDLE, RunStep.LIVE)}
        if after is not before and after in LIGHT_MAY_BE_ON:
            assert RunState.LIVE not in (before, after) or before is RunState.IDLE


@given(paths)
def test_only_an_operator_leaves_a_fault(path: list[tuple[RunStep, RunState]]) -> None:
    for (_, before), (step, after) in itertools.pairwise(path):
        if before is RunState.FAULT:
            assert (step, after) == (RunStep.ACKNOWLEDGE, RunState.IDLE)


@given(paths)
def test_every_run_gets_exactly_one_outcome_before_it_rests(path: list[tuple[RunStep, RunState]]) -> None:
    outcomes: list[RunOutcome] = []
    before = RunState.IDLE
    for step, state in path:
        if step is RunStep.START:
            outcomes = []
        if state is RunState.DISARMING:
            outcomes.append(OUTCOMES[step])
        if step is RunStep.LIVE:
            outcomes = []
        if state in RESTING and step is not RunStep.ACKNOWLEDGE and before is not RunState.LIVE:
            assert len(outcomes) == 1
        before = state


def test_every_state_is_reached_and_can_rest_again() -> None:
    reached = {RunState.IDLE}
    for _ in RunState:
        reached |= {after for (before, _), after in TRANSITIONS.items() if before in reached}
    assert reached == set(RunState)
    resting = set(RESTING)
    for _ in RunState:
        resting |= {before for (before, _), after in TRANSITIONS.items() if after in resting}
    assert resting == set(RunState)


@pytest.mark.parametrize("step", [RunStep.STOP, RunStep.ABORT, RunStep.ERROR])
@pytest.mark.parametrize("state", sorted(IN_A_RUN))
def test_whatever_ends_a_run_disarms(state: RunState, step: RunStep) -> None:
    assert next_state(state, step) is RunState.DISARMING


def test_a_second_start_is_refused_by_name() -> None:
    with pytest.raises(BusyError, match="start is not possible: acquisition is acquiring"):
        next_state(RunState.ACQUIRING, RunStep.START)


def test_an_interrupted_run_has_no_step() -> None:
    """Its process is gone: only the file tells."""
    assert RunOutcome.INTERRUPTED not in OUTCOMES.values()
