"""Refusals: why a run does not start; a code for programs, and what an operator does about it. The only place of both.

``Acquisition.start`` raises the first refusal, ``Acquisition.refusals`` lists all of them: they go through the same
checks in the same order. An error that is a refusal has its code in ``code``.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from enum import StrEnum
from types import MappingProxyType

from daq.errors import BusyError, DaqError, NotAcknowledged, PlanError
from daq.run.events import RunStatus
from daq.run.state import RunState, RunStep, next_state


class RefusalCode(StrEnum):
    """Why a run does not start; ``REMEDIES`` says what to do."""

    STARTING = "starting"
    BUSY = "busy"
    LIGHT_NOT_OFF = "light_not_off"
    PROGRAM_ENDING = "program_ending"
    NOT_ACKNOWLEDGED = "not_acknowledged"
    FOLDER_GONE = "folder_gone"
    STORAGE = "storage"
    DISK_FULL = "disk_full"
    INTERLOCK_OPEN = "interlock_open"
    INTERLOCK_SILENT = "interlock_silent"
    ESTOP_OPEN = "estop_open"
    GENERATOR_FAULT = "generator_fault"
    GENERATOR_SILENT = "generator_silent"
    CAMERA_SILENT = "camera_silent"
    CURRENT = "current"
    TIMING = "timing"
    NETWORK = "network"
    STAGE = "stage"
    REFERENCES = "references"
    REFERENCE_CAMERA = "reference_camera"
    CALIBRATION_UNKNOWN = "calibration_unknown"
    CALIBRATION_DAMAGED = "calibration_damaged"
    CALIBRATION_SIZE = "calibration_size"
    RECIPE = "recipe"


REMEDIES: Mapping[RefusalCode, str] = MappingProxyType(
    {
        RefusalCode.STARTING: "wait until it has started",
        RefusalCode.BUSY: "wait for its end, or stop it",
        RefusalCode.LIGHT_NOT_OFF: "look at the LEDs, cut their supply if they are lit, then acknowledge",
        RefusalCode.PROGRAM_ENDING: "start the server again",
        RefusalCode.NOT_ACKNOWLEDGED: "look for the reason of each cause, then acknowledge one by one",
        RefusalCode.FOLDER_GONE: "mount or bring back the right disk, or start the server again",
        RefusalCode.STORAGE: "look at the disk and at who may write there",
        RefusalCode.DISK_FULL: "delete or move away what is not needed, or take fewer shots",
        RefusalCode.INTERLOCK_OPEN: "close the door",
        RefusalCode.INTERLOCK_SILENT: "check the input of the interlock, see tomoshadow doctor",
        RefusalCode.ESTOP_OPEN: "release the emergency stop",
        RefusalCode.GENERATOR_FAULT: "look for its reason, then acknowledge it",
        RefusalCode.GENERATOR_SILENT: "check cable and supply of the pulse generator; it is opened again by itself",
        RefusalCode.CAMERA_SILENT: "check power and cable of the camera; it is opened again by itself within 2 s",
        RefusalCode.CURRENT: "lower the current of that view",
        RefusalCode.TIMING: "change rate, width or separation to what the text permits",
        RefusalCode.NETWORK: "lower the rate, or give the cameras more network",
        RefusalCode.STAGE: "choose positions that the stage reaches",
        RefusalCode.REFERENCES: "choose other dark and background runs, or record them again",
        RefusalCode.REFERENCE_CAMERA: "put the camera back, or record dark and background again, and calibrate again",
        RefusalCode.CALIBRATION_UNKNOWN: "choose a calibration that exists",
        RefusalCode.CALIBRATION_DAMAGED: "choose another calibration, or copy this one back from a backup",
        RefusalCode.CALIBRATION_SIZE: "choose another calibration, or calibrate again",
        RefusalCode.RECIPE: "correct what is made of every shot, or choose what it needs",
    }
)


def coded(error: DaqError, code: RefusalCode) -> DaqError:
    """The same error as a refusal of this code; one that has a code keeps it."""
    error.code = error.code or code
    return error


@contextmanager
def refusing(code: RefusalCode) -> Iterator[None]:
    """What the block raises is a refusal: of this code, or of the disk where that cannot be read."""
    try:
        yield
    except DaqError as error:
        coded(error, code)
        raise
    except OSError as error:
        reason = PlanError(f"the run cannot be stored, or its calibration not be read: {error}")
        raise coded(reason, RefusalCode.STORAGE) from error


def refused(code: RefusalCode, check: Callable[..., object], *given: object) -> Iterator[DaqError]:
    """What a check raises, as a refusal."""
    try:
        with refusing(code):
            check(*given)
    except DaqError as error:
        yield error


def raise_first(refusals: Iterable[Exception]) -> None:
    """Raise the first refusal; checks behind it are not made."""
    for refusal in refusals:
        raise refusal


def starts_already() -> DaqError:
    """Two starts at once."""
    return coded(BusyError("another run or live view is being started"), RefusalCode.STARTING)


def impossible(step: RunStep, state: RunState, run_id: str | None = None) -> Iterator[DaqError]:
    """Why a step does not follow a state; names the run that is under way."""
    try:
        next_state(state, step)
    except BusyError as busy:
        code = RefusalCode.LIGHT_NOT_OFF if state is RunState.FAULT else RefusalCode.BUSY
        yield coded(BusyError(f"{busy}, run {run_id}") if run_id else busy, code)


def not_acknowledged(status: RunStatus) -> Iterator[DaqError]:
    """Causes of the last end that wait for an operator."""
    if status.to_acknowledge:
        texts = "; ".join(cause.text for cause in status.to_acknowledge)
        reason = f"what ended last had more than one cause; to be acknowledged one by one: {texts}"
        yield coded(NotAcknowledged(reason), RefusalCode.NOT_ACKNOWLEDGED)
