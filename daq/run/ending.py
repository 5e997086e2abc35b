"""RunEnding: what ends a run, said by any thread, obeyed by the acquisition thread."""

import threading
import time

from daq.run.state import OUTCOMES, RunOutcome, RunStep

_OVERRIDDEN_BY = {
    None: frozenset({RunStep.LAST_SHOT, RunStep.STOP, RunStep.ABORT, RunStep.ERROR}),
    RunStep.LAST_SHOT: frozenset({RunStep.ERROR}),
    RunStep.STOP: frozenset({RunStep.ABORT, RunStep.ERROR}),
    RunStep.ABORT: frozenset(),
    RunStep.ERROR: frozenset(),
}


class RunEnding:
    """The ending of one run. The first abort or error stays: what follows is its consequence."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._step: RunStep | None = None
        self._cause = ""

    @property
    def step(self) -> RunStep | None:
        """LAST_SHOT, STOP, ABORT or ERROR; None while nothing ends the run."""
        with self._changed:
            return self._step

    @property
    def at_once(self) -> bool:
        """The shot under way shall not be completed."""
        return self.step in (RunStep.ABORT, RunStep.ERROR)

    @property
    def cause(self) -> str:
        """Why the run ends; empty if it was completed."""
        with self._changed:
            return self._cause

    @property
    def outcome(self) -> RunOutcome:
        """How the run ends; FAILED while nobody has said it."""
        return OUTCOMES[self.step or RunStep.ERROR]

    def end(self, step: RunStep, cause: str = "") -> bool:
        """Ask for the end of the run, from any thread; False if it ends for an earlier reason already."""
        with self._changed:
            if step not in _OVERRIDDEN_BY[self._step]:
                return False
            self._step, self._cause = step, cause
            self._changed.notify_all()
            return True

    def wait_until(self, time_s: float) -> bool:
        """Wait for a time of the monotonic clock; False as soon as something ends the run."""
        with self._changed:
            return not self._changed.wait_for(lambda: self._step, max(0.0, time_s - time.monotonic()))
