"""Faults of the simulated laboratory: what can go wrong, when, to whom, and for how long."""

from enum import StrEnum
from typing import Annotated, Self

from pydantic import Field, model_validator

from daq.frozen_model import FrozenModel


class FaultKind(StrEnum):
    """What can go wrong; ``amount`` of a fault counts the shots it hits unless stated here."""

    PACKET_LOSS = "packet_loss"
    """``amount`` percent of the stream packets never arrive."""
    PACKETS_DOUBLED = "packets_doubled"
    """``amount`` percent of the stream packets arrive twice."""
    PACKETS_SWAPPED = "packets_swapped"
    """``amount`` percent of the stream packets are overtaken by the one behind them."""
    LEADER_LOST = "leader_lost"
    """The first packet of ``amount`` images is lost once."""
    TRAILER_LOST = "trailer_lost"
    """The last packet of ``amount`` images is lost once."""
    BLOCK_DOUBLED = "block_doubled"
    """Every exposure of a shot is sent twice."""
    IDS_WRAP = "ids_wrap"
    """The camera starts to stream so that its 16-bit block ids wrap to 1 after ``amount`` blocks, again and again."""
    MISSED_TRIGGER = "missed_trigger"
    DROPPED_A = "dropped_a"
    DROPPED_B = "dropped_b"
    SWAPPED = "swapped"
    WRONG_SIZE = "wrong_size"
    LATE = "late"
    """One shot is sent ``amount`` seconds late."""
    TIMESTAMP_JUMP = "timestamp_jump"
    """The clock of the camera jumps by ``amount`` seconds."""
    CLOCK_BACK = "clock_back"
    """The clock of the camera goes back by ``amount`` seconds, at most to zero."""
    FROZEN = "frozen"
    """The camera neither answers nor streams, as with its cable out; it keeps its settings."""
    KILLED = "killed"
    """The camera has no power; with power again it has factory settings, its clock and its frame ids start anew."""
    POWER_CYCLED = "power_cycled"
    """The camera has no power for ``amount`` seconds."""
    CONTROL_TAKEN = "control_taken"
    """Another client takes control of the camera; when it gives the camera back, nobody has control."""
    PULSE_B_LOST = "pulse_b_lost"
    """The LED does not answer the second pulse."""
    PULSE_B_LATE = "pulse_b_late"
    """In one shot the second light pulse comes ``amount`` microseconds late."""
    GENERATOR_RESET = "generator_reset"
    """The microcontroller restarts."""
    GENERATOR_WATCHDOG = "generator_watchdog"
    """The microcontroller is restarted by its watchdog, as its program has hung."""
    SET_POINT = "set_point"
    """A current set-point of the pulse generator is another one than was asked for."""
    GENERATOR_HANG = "generator_hang"
    """The microcontroller stands still."""
    GENERATOR_UNPLUGGED = "generator_unplugged"
    """The pulse generator has neither cable nor power; plugged in again, it boots anew at the same path."""
    REPLIES_LOST = "replies_lost"
    """The next ``amount`` replies of the pulse generator vanish."""
    REPLIES_DAMAGED = "replies_damaged"
    """In each of the next ``amount`` replies of the pulse generator a bit flips."""
    SERIAL_GARBAGE = "serial_garbage"
    """``amount`` bytes of noise arrive on the line of the pulse generator."""
    INTERLOCK_OPEN = "interlock_open"
    """Somebody opens the door."""
    ESTOP_PRESSED = "estop_pressed"
    """Somebody presses the emergency stop of the pulse generator."""
    STAGE_STALL = "stage_stall"
    """The carriage of the stage is blocked."""
    STAGE_UNPLUGGED = "stage_unplugged"
    """The cable of the stage is out; plugged in again, the stage is where it was, at the same path."""


LABORATORY_FAULTS = frozenset(
    {
        FaultKind.GENERATOR_RESET,
        FaultKind.GENERATOR_WATCHDOG,
        FaultKind.SET_POINT,
        FaultKind.GENERATOR_HANG,
        FaultKind.GENERATOR_UNPLUGGED,
        FaultKind.REPLIES_LOST,
        FaultKind.REPLIES_DAMAGED,
        FaultKind.SERIAL_GARBAGE,
        FaultKind.INTERLOCK_OPEN,
        FaultKind.ESTOP_PRESSED,
        FaultKind.STAGE_STALL,
        FaultKind.STAGE_UNPLUGGED,
    }
)
"""Faults that happen to no view."""

PACKET_SHARES = frozenset({FaultKind.PACKET_LOSS, FaultKind.PACKETS_DOUBLED, FaultKind.PACKETS_SWAPPED})
"""Faults whose ``amount`` is a percentage."""

LASTING_FAULTS = frozenset(
    {
        *PACKET_SHARES,
        FaultKind.IDS_WRAP,
        FaultKind.FROZEN,
        FaultKind.KILLED,
        FaultKind.CONTROL_TAKEN,
        FaultKind.SET_POINT,
        FaultKind.GENERATOR_HANG,
        FaultKind.GENERATOR_UNPLUGGED,
        FaultKind.INTERLOCK_OPEN,
        FaultKind.ESTOP_PRESSED,
        FaultKind.STAGE_STALL,
        FaultKind.STAGE_UNPLUGGED,
    }
)
"""Faults that last until their ``duration_s`` is over; all others end by themselves."""


_MOST = 100_000
"""A day and some, and as many bytes of noise as a line carries while somebody waits."""


class Fault(FrozenModel):
    """One thing that goes wrong."""

    kind: Annotated[FaultKind, Field(description="what goes wrong")]
    view: Annotated[str | None, Field(description="whose camera or light; none for the faults of the bench")] = None
    amount: Annotated[float, Field(ge=0, le=_MOST, description="how much; see the kind")] = 1.0
    duration_s: Annotated[
        float | None,
        Field(ge=0, le=_MOST, description="of a fault that lasts: its end; 0 ends one that has begun; none: it stays"),
    ] = None

    @model_validator(mode="after")
    def _happens_to_somebody(self) -> Self:
        if (self.view is None) != (self.kind in LABORATORY_FAULTS):
            raise ValueError(f"{self.kind}: {'needs a view' if self.view is None else 'happens to no view'}")
        return self

    @model_validator(mode="after")
    def _is_a_share(self) -> Self:
        if self.kind in PACKET_SHARES and self.amount > 100:
            raise ValueError(f"{self.kind}: {self.amount:g} % is more than all")
        return self

    @model_validator(mode="after")
    def _has_an_end_to_choose(self) -> Self:
        if self.duration_s is not None and self.kind not in LASTING_FAULTS:
            raise ValueError(f"{self.kind}: ends by itself and takes no duration_s")
        return self


class ScriptedFault(Fault):
    """A fault that happens when the generator fires the shot with this sequence number."""

    sequence: Annotated[int, Field(ge=1, description="sequence number of the firing, from 1")]
