"""RunEnding: what ends a run and why, said by any thread, obeyed by the acquisition thread."""

import signal
import threading
import time

from daq.causes import Cause, CauseCode
from daq.devices import Rig
from daq.errors import (
    DeviceError,
    DeviceOvertaken,
    DeviceRefused,
    DiskForbidden,
    DiskFull,
    DiskGone,
    DiskReadOnly,
    InterlockOpen,
    InvalidShots,
    RecorderError,
    RecorderOverflow,
)
from daq.run.state import OUTCOMES, RunOutcome, RunStep

_OVERRIDDEN_BY = {
    None: frozenset({RunStep.LAST_SHOT, RunStep.STOP, RunStep.ABORT, RunStep.ERROR}),
    RunStep.LAST_SHOT: frozenset({RunStep.ERROR}),
    RunStep.STOP: frozenset({RunStep.ABORT, RunStep.ERROR}),
    RunStep.ABORT: frozenset(),
    RunStep.ERROR: frozenset(),
}
_CODES_OF_STEPS = {
    RunStep.STOP: CauseCode.STOPPED,
    RunStep.ABORT: CauseCode.ABORTED,
    RunStep.ERROR: CauseCode.PROGRAM_ERROR,
}
_CODES_OF_ERRORS: dict[type[Exception], CauseCode] = {
    InterlockOpen: CauseCode.INTERLOCK_OPEN,
    InvalidShots: CauseCode.INVALID_SHOTS,
    RecorderOverflow: CauseCode.DISK_SLOW,
    DiskFull: CauseCode.DISK_FULL,
    DiskReadOnly: CauseCode.DISK_READ_ONLY,
    DiskForbidden: CauseCode.DISK_FORBIDDEN,
    DiskGone: CauseCode.DISK_GONE,
    RecorderError: CauseCode.DISK_FAILED,
    OSError: CauseCode.DISK_FAILED,
}
_CONSEQUENCES = (DeviceRefused, DeviceOvertaken)
"""What a device says because it is off already: never the reason."""


def code_of(error: Exception, rig: Rig) -> CauseCode:
    """Cause that an error of a run stands for: by its device, else by its nearest class."""
    if isinstance(error, DeviceError):
        return _code_of_device(error.device, rig)
    kinds = type(error).__mro__
    return next((_CODES_OF_ERRORS[kind] for kind in kinds if kind in _CODES_OF_ERRORS), CauseCode.PROGRAM_ERROR)


def _code_of_device(name: str, rig: Rig) -> CauseCode:
    if name in rig.cameras:
        return CauseCode.CAMERA_FAILED
    if name == rig.generator.name:
        return CauseCode.GENERATOR_FAILED
    if rig.stage is not None and name == rig.stage.name:
        return CauseCode.STAGE_FAILED
    return CauseCode.DEVICE_FAILED


class RunEnding:
    """The ending of one run. The first abort or error stays; a later one of another kind is kept beside it."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._step: RunStep | None = None
        self._causes: list[Cause] = []

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
    def causes(self) -> tuple[Cause, ...]:
        """Why the run ends, the first one first; none if it was completed."""
        with self._changed:
            return tuple(self._causes)

    @property
    def cause(self) -> str:
        """Why the run ends, in words; empty if it was completed."""
        causes = self.causes
        return causes[0].text if causes else ""

    @property
    def outcome(self) -> RunOutcome:
        """How the run ends; FAILED while nobody has said it."""
        return OUTCOMES[self.step or RunStep.ERROR]

    def end(self, step: RunStep, cause: str = "", code: CauseCode | None = None) -> bool:
        """Ask for the end of the run, from any thread; False if it ends for an earlier reason already."""
        with self._changed:
            if step not in _OVERRIDDEN_BY[self._step]:
                return False
            self._step = step
            self._causes = [Cause(code or _CODES_OF_STEPS[step], cause)] if step in _CODES_OF_STEPS else []
            self._changed.notify_all()
            return True

    def fail(self, error: Exception, code: CauseCode) -> bool:
        """End the run by an error; False if it ends already: then the error is kept if it is no consequence of that."""
        with self._changed:
            if self.end(RunStep.ERROR, str(error), code):
                return True
            known = {cause.code for cause in self._causes}
            if code not in known and not isinstance(error, _CONSEQUENCES):
                self._causes.append(Cause(code, str(error)))
            return False

    def wait_until(self, time_s: float) -> bool:
        """Wait for a time of the monotonic clock; False as soon as something ends the run."""
        with self._changed:
            return not self._changed.wait_for(lambda: self._step, max(0.0, time_s - time.monotonic()))

    def wait_for_reason(self, deadline_s: float) -> None:
        """Wait until somebody says why the light went off, but no longer than that."""
        with self._changed:
            self._changed.wait_for(lambda: self.at_once, deadline_s)


def why_it_ends(error: BaseException | None) -> str:
    """Cause of an end together with the program, by the error that ends it."""
    if isinstance(error, KeyboardInterrupt):
        return f"the program was ended by {str(error) or signal.SIGINT.name}"
    return "the program ended before the run did" + (f": {error!r}" if error else "")
