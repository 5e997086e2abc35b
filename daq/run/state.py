"""The states of a run, and the one table that says how they follow each other. Pure."""

from enum import StrEnum
from types import MappingProxyType

from daq.errors import BusyError


class RunState(StrEnum):
    """Where acquisition stands."""

    IDLE = "idle"
    LIVE = "live"
    ARMING = "arming"
    ACQUIRING = "acquiring"
    DISARMING = "disarming"
    FAULT = "fault"


class RunOutcome(StrEnum):
    """How a run ended."""

    COMPLETED = "completed"
    STOPPED = "stopped"
    ABORTED = "aborted"
    FAILED = "failed"
    INTERRUPTED = "interrupted"


class RunStep(StrEnum):
    """What moves a run from one state to the next."""

    START = "start"
    LIVE = "live view"
    ARMED = "armed"
    LAST_SHOT = "last shot recorded"
    STOP = "stop"
    ABORT = "abort"
    ERROR = "error"
    LIGHT_OFF = "light confirmed off"
    LIGHT_UNKNOWN = "light not confirmed off"
    ACKNOWLEDGE = "acknowledge"


_ENDINGS = (RunStep.STOP, RunStep.ABORT, RunStep.ERROR)

TRANSITIONS = MappingProxyType(
    {
        (RunState.IDLE, RunStep.LIVE): RunState.LIVE,
        (RunState.LIVE, RunStep.LIGHT_OFF): RunState.IDLE,
        (RunState.LIVE, RunStep.LIGHT_UNKNOWN): RunState.FAULT,
        (RunState.IDLE, RunStep.START): RunState.ARMING,
        (RunState.ARMING, RunStep.ARMED): RunState.ACQUIRING,
        (RunState.ACQUIRING, RunStep.LAST_SHOT): RunState.DISARMING,
        **{(RunState.ARMING, step): RunState.DISARMING for step in _ENDINGS},
        **{(RunState.ACQUIRING, step): RunState.DISARMING for step in _ENDINGS},
        (RunState.DISARMING, RunStep.LIGHT_OFF): RunState.IDLE,
        (RunState.DISARMING, RunStep.LIGHT_UNKNOWN): RunState.FAULT,
        (RunState.FAULT, RunStep.ACKNOWLEDGE): RunState.IDLE,
    }
)
"""Every permitted transition.

Light can be on in ARMING and ACQUIRING, which lead to DISARMING, and in LIVE. Nothing leads out of DISARMING and LIVE
but the answer whether it is off.
"""

OUTCOMES = MappingProxyType(
    {
        RunStep.LAST_SHOT: RunOutcome.COMPLETED,
        RunStep.STOP: RunOutcome.STOPPED,
        RunStep.ABORT: RunOutcome.ABORTED,
        RunStep.ERROR: RunOutcome.FAILED,
        RunStep.LIGHT_UNKNOWN: RunOutcome.FAILED,
    }
)
"""The outcome that a step gives to the run."""


def next_state(state: RunState, step: RunStep) -> RunState:
    """State after a step.

    Raises
    ------
    BusyError
        The step is not permitted in this state; the text names both.
    """
    try:
        return TRANSITIONS[state, step]
    except KeyError:
        raise BusyError(f"{step.value} is not possible: acquisition is {state.value}") from None
