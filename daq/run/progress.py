"""RunProgress: where acquisition stands, and the one who tells it; every run has it as its listener."""

import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from daq.causes import Cause, to_acknowledge
from daq.run.ending import RunEnding
from daq.run.events import RunEvent, RunMessage, RunStatus, ShotRecorded, StateChanged, Waiting
from daq.run.state import RunState, RunStep, next_state
from daq.run_plan import LivePlan, RunPlan
from daq.shot import Shot


class RunProgress:
    """State of acquisition; every method may be called from any thread, none waits for a device.

    State, counts and events change under one lock: events come in the order in which things happened.

    Parameters
    ----------
    publish : Callable[[RunEvent], None]
        Gets every event; must not block.
    """

    def __init__(self, publish: Callable[[RunEvent], None]) -> None:
        self._publish = publish
        self._changed = threading.Condition()
        self._status = RunStatus()
        self._newest: Shot | None = None

    def status(self) -> RunStatus:
        """Snapshot."""
        with self._changed:
            return self._status

    def wait(self, deadline_s: float) -> RunStatus:
        """Wait until no run and no live view is under way; returns the status then, or the one at the deadline."""
        with self._changed:
            self._changed.wait_for(lambda: self._status.resting, deadline_s)
            return self._status

    def begin(self, run_id: str, plan: RunPlan) -> None:
        """A run starts, with all counts at zero; BusyError if it cannot."""
        self.move(RunStep.START, **vars(RunStatus(run_id=run_id, shots_planned=plan.total_shots, plan=plan)))

    def begin_live(self, plan: LivePlan) -> None:
        """A live view starts; BusyError if it cannot. What is known of the last run stays, but for its causes."""
        self.move(RunStep.LIVE, live=plan, message=str(plan), causes=())

    def move(self, step: RunStep, **changes: Any) -> None:
        """Go to the state after a step, and change other fields of the status; BusyError if it is not permitted."""
        with self._changed:
            before, state = self._status.state, next_state(self._status.state, step)
            status = self._status = replace(self._status, **{"waiting": None, **changes, "state": state})
            is_of_run = RunState.LIVE not in (before, state) and step is not RunStep.ACKNOWLEDGE
            run_id, outcome = (status.run_id or "", status.outcome) if is_of_run else ("", None)
            self._publish(StateChanged(run_id, state, outcome, status.message))
            self._changed.notify_all()

    def end(self, step: RunStep, ending: RunEnding, **changes: Any) -> None:
        """A run or a live view is over; if it had several causes, each is to be acknowledged by itself."""
        with self._changed:
            waiting = to_acknowledge(ending.causes)
            for cause in waiting[1:]:
                self.tell(self._run_id, f"a second cause, to be acknowledged by itself: {cause.text}")
            about = {"causes": ending.causes, "ended_run": self._run_id}
            self.move(step, to_acknowledge=waiting, **about, **changes)

    def acknowledge(self, causes: Sequence[Cause]) -> None:
        """The operator has seen to causes that wait; the last one ends FAULT."""
        with self._changed:
            waiting = tuple(cause for cause in self._status.to_acknowledge if cause not in causes)
            self._status = replace(self._status, to_acknowledge=waiting)
            for cause in causes:
                self.tell(self._status.ended_run, f"acknowledged: {cause.text}")
            if self._status.state is RunState.FAULT and not waiting:
                self.move(RunStep.ACKNOWLEDGE)

    @property
    def newest_shot(self) -> Shot | None:
        """What the rig saw last, in a run or a live view."""
        return self._newest

    def show(self, shot: Shot) -> None:
        """A shot has been taken."""
        self._newest = shot

    def wait_for(self, text: str) -> None:
        """Something is waited for from now on, unless it is already."""
        with self._changed:
            if self._status.waiting is None or self._status.waiting.text != text:
                self._status = replace(self._status, waiting=Waiting(text, time.monotonic()))

    def count(self, shot: Shot, fault: str = "") -> None:
        """A shot has reached the disk; what is wrong with it."""
        with self._changed:
            status = self._status
            recorded, valid = status.shots_recorded + 1, status.shots_valid + shot.valid
            self._status = replace(status, shots_recorded=recorded, shots_valid=valid)
            self._publish(ShotRecorded(status.run_id or "", shot.index, shot.valid, fault))

    def say(self, text: str) -> None:
        """Something is worth a line."""
        with self._changed:
            self._status = replace(self._status, message=text)
            self.tell(self._run_id, text)

    @property
    def _run_id(self) -> str:
        return "" if self._status.live else self._status.run_id or ""

    def tell(self, run_id: str, text: str) -> None:
        """Something is worth a line of a run that is over."""
        with self._changed:
            self._publish(RunMessage(run_id, text))
