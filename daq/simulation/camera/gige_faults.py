"""Faults of a simulated camera; each one happens on the wire, as it would in the laboratory."""

from dataclasses import dataclass, field
from threading import Lock
from typing import Literal

ShotFault = Literal[
    "missed_triggers",
    "dropped_a",
    "dropped_b",
    "swapped",
    "late",
    "wrong_size",
    "doubled",
    "leaders_lost",
    "trailers_lost",
]


@dataclass
class CameraFaults:
    """What goes wrong; every field may be set while the camera runs.

    Parameters
    ----------
    packet_loss : float
        Fraction of stream packets that never arrive, resent ones included.
    packets_doubled : float
        Fraction of stream packets that arrive twice.
    packets_swapped : float
        Fraction of stream packets that are overtaken by the one behind them.
    leaders_lost, trailers_lost : int
        Of so many next blocks the first (last) packet does not arrive, until it is asked for again.
    blocks_before_wrap : int
        So many blocks of every acquisition come before the block ids wrap; 0: 65535, as they start at 1.
    missed_triggers : int
        So many next trigger edges are not seen at all.
    dropped_a, dropped_b : int
        In so many next shots exposure A (B) consumes its block id, but no packet of it is sent.
    swapped : int
        In so many next shots B is sent before A.
    doubled : int
        In so many next shots every block is sent twice.
    late : int
        So many next shots are sent only after ``late_s``.
    late_s : float
        How much later.
    wrong_size : int
        In so many next shots both images have half their rows.
    timestamp_jump_ns : int
        Added to the device clock; may be negative.
    frozen : bool
        The camera neither answers nor streams.
    held_by_another : bool
        Another client holds control, and keeps it.
    """

    packet_loss: float = 0.0
    packets_doubled: float = 0.0
    packets_swapped: float = 0.0
    leaders_lost: int = 0
    trailers_lost: int = 0
    blocks_before_wrap: int = 0
    missed_triggers: int = 0
    dropped_a: int = 0
    dropped_b: int = 0
    swapped: int = 0
    doubled: int = 0
    late: int = 0
    late_s: float = 0.0
    wrong_size: int = 0
    timestamp_jump_ns: int = 0
    frozen: bool = False
    held_by_another: bool = False
    _lock: Lock = field(default_factory=Lock, repr=False, compare=False)

    def forget_what_power_ends(self) -> None:
        """What a camera that gets power again knows nothing of."""
        self.timestamp_jump_ns, self.frozen, self.held_by_another = 0, False, False

    def take(self, fault: ShotFault) -> bool:
        """True if the fault hits this shot, or block; uses up one of them."""
        with self._lock:
            left = int(getattr(self, fault))
            setattr(self, fault, max(0, left - 1))
        return left > 0
