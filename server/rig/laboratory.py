"""Laboratory: what may be done to a simulated rig, in whatever process its far ends run."""

from typing import Protocol

from daq.faults import Fault


class Laboratory(Protocol):
    """Doors to open, and faults to inject."""

    @property
    def is_apart(self) -> bool:
        """Its far ends run in another process, which may end."""

    def ask(self) -> str:
        """Who runs its far ends; DeviceUnavailable if they do not answer."""

    def inject(self, fault: Fault) -> None:
        """Let something go wrong; ValueError if the laboratory has no such view."""

    def open_door(self) -> None:
        """Open the interlock."""

    def close_door(self) -> None:
        """Allow light."""
