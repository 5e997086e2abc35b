"""Faults of the simulated laboratory: what can go wrong, when, and to whom."""

from enum import StrEnum
from typing import Annotated, Self

from pydantic import Field, model_validator

from daq.frozen_model import FrozenModel


class FaultKind(StrEnum):
    """What can go wrong; ``amount`` of a fault counts the shots it hits unless stated here."""

    PACKET_LOSS = "packet_loss"
    """``amount`` percent of the stream packets never arrive, from now on."""
    MISSED_TRIGGER = "missed_trigger"
    DROPPED_A = "dropped_a"
    DROPPED_B = "dropped_b"
    SWAPPED = "swapped"
    WRONG_SIZE = "wrong_size"
    LATE = "late"
    """One shot is sent ``amount`` seconds late."""
    TIMESTAMP_JUMP = "timestamp_jump"
    """The clock of the camera jumps by ``amount`` seconds."""
    FROZEN = "frozen"
    """The camera neither answers nor streams any more."""
    KILLED = "killed"
    """The address answers no more."""
    CONTROL_TAKEN = "control_taken"
    """Another client takes control of the camera, and keeps it."""
    PULSE_B_LOST = "pulse_b_lost"
    """The LED does not answer the second pulse."""
    PULSE_B_LATE = "pulse_b_late"
    """In one shot the second light pulse comes ``amount`` microseconds late."""
    GENERATOR_RESET = "generator_reset"
    """The microcontroller restarts."""
    SERIAL_GARBAGE = "serial_garbage"
    """``amount`` bytes of noise arrive on the line of the pulse generator."""
    INTERLOCK_OPEN = "interlock_open"
    """Somebody opens the door."""
    STAGE_STALL = "stage_stall"
    """The carriage of the stage is blocked."""


LABORATORY_FAULTS = frozenset(
    {FaultKind.GENERATOR_RESET, FaultKind.SERIAL_GARBAGE, FaultKind.INTERLOCK_OPEN, FaultKind.STAGE_STALL}
)
"""Faults that happen to no view."""


class Fault(FrozenModel):
    """One thing that goes wrong."""

    kind: Annotated[FaultKind, Field(description="what goes wrong")]
    view: Annotated[str | None, Field(description="whose camera or light; none for the faults of the bench")] = None
    amount: Annotated[float, Field(ge=0, description="how much; see the kind")] = 1.0

    @model_validator(mode="after")
    def _happens_to_somebody(self) -> Self:
        if (self.view is None) != (self.kind in LABORATORY_FAULTS):
            raise ValueError(f"{self.kind}: {'needs a view' if self.view is None else 'happens to no view'}")
        return self


class ScriptedFault(Fault):
    """A fault that happens when the generator fires the shot with this sequence number."""

    sequence: Annotated[int, Field(ge=1, description="sequence number of the firing, from 1")]
