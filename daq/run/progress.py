"""RunProgress: where acquisition stands, and the one who tells it; every run has it as its listener."""

import threading
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from daq.run.events import RunEvent, RunMessage, RunStatus, ShotRecorded, StateChanged
from daq.run.state import RunStep, next_state
from daq.run_plan import RunPlan
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

    def status(self) -> RunStatus:
        """Snapshot."""
        with self._changed:
            return self._status

    def wait(self, deadline_s: float) -> RunStatus:
        """Wait until no run is active; returns the status then, or the one at the deadline."""
        with self._changed:
            self._changed.wait_for(lambda: not self._status.active, deadline_s)
            return self._status

    def begin(self, run_id: str, plan: RunPlan) -> None:
        """A run starts, with all counts at zero; BusyError if it cannot."""
        self.move(RunStep.START, **vars(RunStatus(run_id=run_id, shots_planned=plan.total_shots, plan=plan)))

    def move(self, step: RunStep, **changes: Any) -> None:
        """Go to the state after a step, and change other fields of the status; BusyError if it is not permitted."""
        with self._changed:
            state = next_state(self._status.state, step)
            status = self._status = replace(self._status, **{**changes, "state": state})
            self._publish(StateChanged(status.run_id or "", state, status.outcome, status.message))
            self._changed.notify_all()

    def count(self, shot: Shot) -> None:
        """A shot has reached the disk."""
        with self._changed:
            status = self._status
            recorded, valid = status.shots_recorded + 1, status.shots_valid + shot.valid
            self._status = replace(status, shots_recorded=recorded, shots_valid=valid)
            self._publish(ShotRecorded(status.run_id or "", shot.index, shot.valid))

    def say(self, text: str) -> None:
        """Something is worth a line."""
        with self._changed:
            self._status = replace(self._status, message=text)
            self.tell(self._status.run_id or "", text)

    def tell(self, run_id: str, text: str) -> None:
        """Something is worth a line of a run that is over."""
        with self._changed:
            self._publish(RunMessage(run_id, text))
