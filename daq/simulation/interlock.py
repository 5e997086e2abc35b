"""Interlock of the simulated laboratory: the switch that a visitor of the laboratory moves, and a chain in memory."""

import threading
from types import TracebackType
from typing import Protocol, Self

from daq.devices import DeviceIdentity


class DoorSwitch(Protocol):
    """The laboratory's side of an interlock; open after construction."""

    def close_door(self) -> None:
        """Let the chain conduct."""

    def open_door(self) -> None:
        """Interrupt the chain."""

    def break_wire(self) -> None:
        """Cut the cable."""


class MemoryInterlock:
    """Interlock and its switch in one object, for machines that cannot have a simulated GPIO chip.

    Parameters
    ----------
    name : str
        Name in the rig configuration.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._changed = threading.Condition()
        self._closed, self._edges = False, 0

    @property
    def name(self) -> str:
        """Name in the rig configuration."""
        return self._name

    def __enter__(self) -> Self:
        with self._changed:
            self._edges = 0
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Nothing is held."""

    def identity(self) -> DeviceIdentity:
        """It says that it is simulated."""
        return DeviceIdentity("tomoshadow", "interlock in memory", "simulated", "1")

    def is_closed(self) -> bool:
        """True while light is allowed."""
        with self._changed:
            return self._closed

    def wait_for_change(self, deadline_s: float) -> bool:
        """Wait until an edge has come since the last call; False if there was none within the deadline."""
        with self._changed:
            changed = self._changed.wait_for(lambda: self._edges > 0, deadline_s)
            self._edges = 0
            return changed

    def close_door(self) -> None:
        """Let the chain conduct."""
        self._switch(True)

    def open_door(self) -> None:
        """Interrupt the chain."""
        self._switch(False)

    def break_wire(self) -> None:
        """Cut the cable: the chain is interrupted."""
        self._switch(False)

    def _switch(self, closed: bool) -> None:
        with self._changed:
            self._edges += closed != self._closed
            self._closed = closed
            self._changed.notify_all()
