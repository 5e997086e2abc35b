"""GpioInterlock: the door and enclosure switches on an input line of a GPIO chip, read through libgpiod 2."""

import threading
from types import TracebackType
from typing import Self

import gpiod
from gpiod.line import Bias, Direction, Edge, Value

from daq.devices import DeviceIdentity
from daq.errors import DeviceUnavailable


class GpioInterlock:
    """Interlock chain on one input line; a broken wire reads as open.

    The chain conducts while every door is closed. Wired to the supply it drives the line high against the
    pull-down chosen here; wired to ground (``active_low``) it drives the line low against a pull-up. So a
    cut wire, a pulled connector and an unpowered switch all look like an open door.

    Parameters
    ----------
    name : str
        Name in the rig configuration.
    chip_path : str
        The chip, for example ``/dev/gpiochip0``.
    line : int
        Offset of the line on the chip.
    active_low : bool
        The closed chain connects the line to ground instead of to the supply.
    """

    def __init__(self, name: str, chip_path: str, line: int, *, active_low: bool = False) -> None:
        self._name, self._chip_path, self._line = name, chip_path, line
        self._settings = gpiod.LineSettings(
            direction=Direction.INPUT,
            edge_detection=Edge.BOTH,
            bias=Bias.PULL_UP if active_low else Bias.PULL_DOWN,
            active_low=active_low,
        )
        self._request: gpiod.LineRequest | None = None
        self._reading = threading.Lock()

    @property
    def name(self) -> str:
        """Name in the rig configuration."""
        return self._name

    def __enter__(self) -> Self:
        try:
            self._request = gpiod.request_lines(
                self._chip_path, consumer="tomoshadow", config={self._line: self._settings}
            )
        except (OSError, ValueError) as error:
            raise self._unavailable(error) from error
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._request is not None:
            with self._reading:
                self._request.release()
                self._request = None

    def identity(self) -> DeviceIdentity:
        """Label, name and line of the chip, and the version of libgpiod that reads it."""
        try:
            with gpiod.Chip(self._chip_path) as chip:
                info = chip.get_info()
        except OSError as error:
            raise self._unavailable(error) from error
        return DeviceIdentity("GPIO", info.label, f"{info.name} line {self._line}", f"libgpiod {gpiod.api_version}")

    def is_closed(self) -> bool:
        """True while the chain conducts: light is allowed."""
        with self._reading:
            try:
                return self._opened().get_value(self._line) is Value.ACTIVE
            except OSError as error:
                raise self._unavailable(error) from error

    def wait_for_change(self, deadline_s: float) -> bool:
        """Wait until an edge has come since the last call; False if there was none within the deadline."""
        request = self._opened()
        try:
            if not request.wait_edge_events(deadline_s):
                return False
            with self._reading:
                # Another waiting thread may have read the edges meanwhile; then reading again would block.
                return bool(request.wait_edge_events(0) and request.read_edge_events())
        except (OSError, gpiod.RequestReleasedError) as error:
            raise self._unavailable(error) from error

    def _opened(self) -> gpiod.LineRequest:
        if self._request is None:
            raise DeviceUnavailable(self._name, f"line {self._line} of {self._chip_path} is not open")
        return self._request

    def _unavailable(self, error: Exception) -> DeviceUnavailable:
        reason = error.strerror if isinstance(error, OSError) else error
        return DeviceUnavailable(self._name, f"line {self._line} of {self._chip_path}: {reason}")


def library_path() -> str:
    """File of the loaded libgpiod; the simulated chip attaches itself to it."""
    return gpiod._ext.__file__
