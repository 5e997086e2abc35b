"""RigState: the state of the whole rig in one word; READY only where a start would not be refused. Pure."""

from collections.abc import Sequence
from enum import StrEnum
from typing import Annotated

from pydantic import Field

from daq.frozen_model import FrozenModel
from daq.run.events import RunStatus
from daq.run.state import RunState
from server.lab.desk.reason import Reason


class RigWord(StrEnum):
    """What the rig is up to."""

    READY = "ready"
    NOT_READY = "not ready"
    LIVE = "live"
    ARMING = "arming"
    ACQUIRING = "acquiring"
    DISARMING = "disarming"
    FAULT = "fault"


class RigState(FrozenModel):
    """State of the whole rig, and what speaks against a start."""

    state: Annotated[RigWord, Field(description="ready: a start would not be refused")]
    text: Annotated[str, Field(description="the same for people, with what belongs to it")]
    reasons: Annotated[
        tuple[Reason, ...], Field(description="everything against a start, the first one first; empty: nothing")
    ]
    eta_s: Annotated[float | None, Field(description="until the last shot of the run under way; null: nobody knows")]


def rig_state(status: RunStatus, reasons: Sequence[Reason], eta_s: float | None = None) -> RigState:
    """Add up what acquisition does and what speaks against a start."""
    word = _word(status.state, reasons)
    return RigState(state=word, text=_text(word, status, reasons, eta_s), reasons=tuple(reasons), eta_s=eta_s)


def _word(state: RunState, reasons: Sequence[Reason]) -> RigWord:
    if state is not RunState.IDLE:
        return RigWord(state.value)
    return RigWord.NOT_READY if reasons else RigWord.READY


def _text(word: RigWord, status: RunStatus, reasons: Sequence[Reason], eta_s: float | None) -> str:
    title = word.value.upper()
    if word is RigWord.ACQUIRING:
        counts = f"{title} {status.shots_recorded}/{status.shots_planned}"
        return counts if eta_s is None else f"{counts}, {minutes(eta_s)} left"
    return f"{title}: {reasons[0].text}" if word is RigWord.NOT_READY else title


def minutes(time_s: float) -> str:
    """A time as a clock shows it."""
    whole_s = round(time_s)
    hours, rest_s = divmod(whole_s, 3600)
    minutes, seconds = divmod(rest_s, 60)
    return f"{hours}:{minutes:02}:{seconds:02}" if hours else f"{minutes}:{seconds:02}"
