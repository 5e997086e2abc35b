"""Why a run ends: a code for programs, and for operators what it means and what to do. The only place of both."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from enum import StrEnum
from types import MappingProxyType
from typing import Annotated

from pydantic import Field


class CauseCode(StrEnum):
    """Why a run ended; ``EXPLANATIONS`` says what each means and what to do."""

    STOPPED = "stopped"
    ABORTED = "aborted"
    PROGRAM_ENDED = "program_ended"
    PROCESS_DIED = "process_died"
    INTERLOCK_OPEN = "interlock_open"
    GENERATOR_FAILED = "generator_failed"
    CAMERA_FAILED = "camera_failed"
    STAGE_FAILED = "stage_failed"
    DEVICE_FAILED = "device_failed"
    INVALID_SHOTS = "invalid_shots"
    DISK_SLOW = "disk_slow"
    DISK_FULL = "disk_full"
    DISK_READ_ONLY = "disk_read_only"
    DISK_FORBIDDEN = "disk_forbidden"
    DISK_GONE = "disk_gone"
    DISK_FAILED = "disk_failed"
    LIGHT_NOT_OFF = "light_not_off"
    PROGRAM_ERROR = "program_error"


@dataclass(frozen=True)
class Explanation:
    """What a cause means, and what an operator does about it."""

    meaning: str
    remedy: str


EXPLANATIONS: Mapping[CauseCode, Explanation] = MappingProxyType(
    {
        CauseCode.STOPPED: Explanation("an operator stopped the run", "nothing"),
        CauseCode.ABORTED: Explanation("an operator aborted the run", "nothing"),
        CauseCode.PROGRAM_ENDED: Explanation("the server was ended by a signal", "start the server, start again"),
        CauseCode.PROCESS_DIED: Explanation(
            "power failed, or the server was killed or crashed", "start the server, start again"
        ),
        CauseCode.INTERLOCK_OPEN: Explanation(
            "a door, or the emergency stop, is open", "close it, acknowledge the fault of the generator, start again"
        ),
        CauseCode.GENERATOR_FAILED: Explanation(
            "the pulse generator did not answer, restarted, refused, or has a fault",
            "check its cable and supply, acknowledge its fault, start again",
        ),
        CauseCode.CAMERA_FAILED: Explanation(
            "a camera does not answer, refuses, or another program has it",
            "check power and cable of the view, end the other program, start again",
        ),
        CauseCode.STAGE_FAILED: Explanation(
            "the stage does not answer or did not arrive", "free its carriage, check its cable, start again"
        ),
        CauseCode.DEVICE_FAILED: Explanation("another device does not answer", "check the device that is named"),
        CauseCode.INVALID_SHOTS: Explanation(
            "too many shots in a row are invalid, or not one of the run is valid",
            "check light, cable and network of the view that is named, start again",
        ),
        CauseCode.DISK_SLOW: Explanation(
            "the disk does not keep up with the cameras", "lower the rate, or a faster disk"
        ),
        CauseCode.DISK_FULL: Explanation(
            "the disk is full, or the margin that a run leaves free is reached",
            "delete or move away what is not needed, start again",
        ),
        CauseCode.DISK_READ_ONLY: Explanation(
            "the disk takes nothing any more, as after a fault of it", "look at it, mount it for writing, start again"
        ),
        CauseCode.DISK_FORBIDDEN: Explanation("the permission to write is missing", "give it back, start again"),
        CauseCode.DISK_GONE: Explanation(
            "the directory was moved or deleted, or its disk is not mounted", "bring it back, start again"
        ),
        CauseCode.DISK_FAILED: Explanation(
            "a shot cannot be stored", "look at the disk, or use another one, start again"
        ),
        CauseCode.LIGHT_NOT_OFF: Explanation(
            "the generator did not confirm that the light is off", "look at the LEDs, cut their supply, acknowledge"
        ),
        CauseCode.PROGRAM_ERROR: Explanation("an error of the program", "keep the log, report it, start again"),
    }
)


@dataclass(frozen=True)
class Cause:
    """One reason why a run ended."""

    code: Annotated[CauseCode, Field(description="for programs")]
    text: Annotated[str, Field(description="names device, value and limit")]
    at_utc: Annotated[str, Field(description="when it was noticed, ISO 8601")] = field(
        default_factory=lambda: datetime.now(UTC).isoformat()
    )

    @property
    def remedy(self) -> str:
        """What to do."""
        return EXPLANATIONS[self.code].remedy


_BY_OPERATOR = frozenset({CauseCode.STOPPED, CauseCode.ABORTED, CauseCode.PROGRAM_ENDED})


def wrong(causes: tuple[Cause, ...]) -> tuple[Cause, ...]:
    """What went wrong: all but what the operator did himself."""
    return tuple(cause for cause in causes if cause.code not in _BY_OPERATOR)


def to_acknowledge(causes: tuple[Cause, ...]) -> tuple[Cause, ...]:
    """What an operator has to acknowledge one by one, so that no cause hides another; a single one hides none.

    The state FAULT stands for a light that was not confirmed off.
    """
    if len(causes) < 2:
        return ()
    return tuple(cause for cause in wrong(causes) if cause.code is not CauseCode.LIGHT_NOT_OFF)
