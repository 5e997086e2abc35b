"""SimulatedStage: a translation stage on a pseudo terminal, as its serial line sees it."""

import contextlib
import os
import select
import threading
import time
import tty
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np

from daq.drivers.zaber_protocol import Command, MessageError, Reply, encode_reply, parse_command
from daq.simulation.port_link import PortLink

SETTINGS = {"device.id": "50419", "system.serial": "100042", "version": "7.38"}
"""Answers of an X-LSM stage to questions about itself."""


class SimulatedStage:
    """Instrument model: finite speed, scatter of the positions, warnings, faults.

    It wakes up unreferenced, as the real one does after power-up, and must be homed.

    Parameters
    ----------
    travel_mm : float
        Length of travel from the home switch.
    speed_mm_s : float
        Speed of every movement.
    scatter_um : float
        Largest deviation of a position from the one asked for; the replies tell the position truly reached.
    microstep_um : float
        Length of one count.
    seed : int
        Of the scatter.
    port : Path | None
        Where its serial port shall be; else in a folder of its own.
    """

    def __init__(
        self,
        travel_mm: float = 50.0,
        *,
        speed_mm_s: float = 25.0,
        scatter_um: float = 2.0,
        microstep_um: float = 0.047625,
        seed: int = 0,
        port: Path | None = None,
    ) -> None:
        self._travel_mm, self._speed_mm_s = travel_mm, speed_mm_s
        self._scatter_um, self._microstep_um = scatter_um, microstep_um
        self._random = np.random.default_rng(seed)
        self._state = threading.Lock()
        self._from_mm, self._to_mm, self._started_s = 0.3 * travel_mm, 0.3 * travel_mm, 0.0
        self._warning, self._stalled, self._garbled = "WR", False, 0
        self._thread: threading.Thread | None = None
        self._link = PortLink("stage", port)
        self._actions: dict[str, Callable[[str], str]] = {
            "": lambda _: "0",
            "get": self._get,
            "set": lambda _: "0",
            "home": lambda _: self._move(0.0),
            "move": self._move_abs,
            "stop": lambda _: self._move(self.position_mm),
            "warnings": lambda _: self._clear_warnings(),
        }

    def __enter__(self) -> Self:
        self.plug_in()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.unplug()
        self._link.remove()

    @property
    def port(self) -> str:
        """Path of the serial port to open; the same whenever it is plugged in."""
        return self._link.path

    @property
    def position_mm(self) -> float:
        """Where the stage truly is now, on its own scale."""
        path_mm = self._to_mm - self._from_mm
        driven_mm = self._speed_mm_s * (time.monotonic() - self._started_s)
        if self._stalled:
            return self._from_mm
        return self._to_mm if driven_mm >= abs(path_mm) else self._from_mm + np.sign(path_mm) * driven_mm

    @property
    def is_stalled(self) -> bool:
        """The carriage is blocked."""
        return self._stalled

    def stall(self, stalled: bool = True) -> None:
        """Block the carriage: this movement, or else the next one, ends at once with a fault flag."""
        with self._state:
            if stalled and self.position_mm != self._to_mm:
                self._warning = "FS"
            self._from_mm = self._to_mm = self.position_mm
            self._stalled = stalled

    def garble(self, replies: int) -> None:
        """Damage one character of the next replies."""
        with self._state:
            self._garbled = replies

    def plug_in(self) -> None:
        """Plug the cable in: a new device at the same path. The stage itself has always had power."""
        if self._thread is not None:
            return
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        self._end_read, self._end_write = os.pipe()
        self._thread = threading.Thread(target=self._serve, name="simulated stage", daemon=True)
        self._thread.start()
        self._link.lead_to(os.ttyname(self._slave))

    def unplug(self) -> None:
        """Pull the cable; the other end sees a hang-up."""
        if self._thread is None:
            return
        self._link.lead_nowhere()
        os.write(self._end_write, b"x")
        self._thread.join()
        self._thread = None
        for descriptor in (self._master, self._slave, self._end_read, self._end_write):
            os.close(descriptor)

    def _serve(self) -> None:
        pending = b""
        while self._end_read not in (ready := select.select([self._master, self._end_read], [], [])[0]):
            if ready:
                *lines, pending = (pending + os.read(self._master, 4096)).split(b"\n")
                for line in lines:
                    with contextlib.suppress(MessageError):  # a damaged command gets no answer, as on the real one
                        os.write(self._master, self._damage(encode_reply(self._answer(parse_command(line)))))

    def _answer(self, command: Command) -> Reply:
        with self._state:
            action, _, rest = command.text.partition(" ")
            data = self._actions[action](rest) if action in self._actions else "BADCOMMAND"
            moving = self.position_mm != self._to_mm
            accepted = not data.startswith("BAD")
            return Reply(command.device, command.axis, command.message_id, accepted, moving, self._warning, data)

    def _get(self, setting: str) -> str:
        if setting == "pos":
            return str(round(self.position_mm * 1000 / self._microstep_um))
        return SETTINGS.get(setting, "BADCOMMAND")

    def _move_abs(self, rest: str) -> str:
        how, _, counts = rest.partition(" ")
        if how != "abs" or not counts.removeprefix("-").isdigit():
            return "BADCOMMAND"
        target_mm = int(counts) * self._microstep_um / 1000
        if self._warning == "WR" or not 0 <= target_mm <= self._travel_mm:
            return "BADDATA"
        return self._move(target_mm + self._random.uniform(-1, 1) * self._scatter_um / 1000)

    def _move(self, target_mm: float) -> str:
        if self._stalled:
            self._warning = "FS"
            return "0"
        if target_mm == 0.0:
            self._warning = "--"
        self._from_mm, self._to_mm, self._started_s = self.position_mm, target_mm, time.monotonic()
        return "0"

    def _clear_warnings(self) -> str:
        if self._warning != "WR":
            self._warning = "--"
        return "0"

    def _damage(self, line: bytes) -> bytes:
        with self._state:
            if not self._garbled:
                return line
            self._garbled -= 1
            return line[:4] + b"?" + line[5:]
