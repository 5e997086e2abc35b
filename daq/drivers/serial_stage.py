"""SerialStage: a motorised translation stage that speaks Zaber's ASCII protocol over a serial line."""

import termios
import threading
import time
from dataclasses import dataclass
from types import TracebackType
from typing import Self

import serial

from daq.devices import DeviceIdentity
from daq.drivers.zaber_protocol import Command, MessageError, Reply, encode_command, parse_reply
from daq.errors import DeviceRefused, DeviceTimeout, DeviceUnavailable, ProtocolError

UNREFERENCED = ("WR", "WH")
"""Warning flags of an axis that does not know where it is, or was not homed since power-up."""

ATTEMPTS = 3
"""Every command used here may be repeated: questions, absolute moves, home and stop."""


@dataclass(frozen=True)
class StageScale:
    """How the stage's own counter relates to z.

    Parameters
    ----------
    microstep_um : float
        Length of one count; the data sheet's "microstep size" (0.047625 um for an X-LSM).
    zero_mm : float
        Position on the stage's own scale, from its home switch, where z is 0.
    """

    microstep_um: float = 0.047625
    zero_mm: float = 0.0

    def counts(self, z_mm: float) -> int:
        """Position counter at z."""
        return round((z_mm + self.zero_mm) * 1000 / self.microstep_um)

    def z_mm(self, counts: int) -> float:
        """Height z of a position counter."""
        return counts * self.microstep_um / 1000 - self.zero_mm


class SerialStage:
    """Driver of one axis; homes before the first move where the stage has lost its reference.

    Parameters
    ----------
    name : str
        Name in the rig configuration.
    port : str
        Serial port, for example ``/dev/ttyUSB1``.
    range_mm : tuple[float, float]
        Lowest and highest z that the rig permits.
    scale : StageScale
        Counts to mm.
    device, axis : int
        Address in the chain of stages.
    reply_limit_s, move_limit_s : float
        Deadlines of a reply and of a whole movement.
    poll_s : float
        Distance of two questions whether a movement is over.
    """

    def __init__(
        self,
        name: str,
        port: str,
        range_mm: tuple[float, float],
        *,
        scale: StageScale | None = None,
        device: int = 1,
        axis: int = 1,
        reply_limit_s: float = 0.5,
        move_limit_s: float = 60.0,
        poll_s: float = 0.01,
    ) -> None:
        self._name, self._port, self._range_mm = name, port, range_mm
        self._scale = scale or StageScale()
        self._device, self._axis = device, axis
        self._reply_limit_s, self._move_limit_s, self._poll_s = reply_limit_s, move_limit_s, poll_s
        self._line: serial.Serial | None = None
        self._identity = DeviceIdentity("Zaber", "", "", "")
        self._talking, self._closing = threading.Lock(), threading.Event()
        self._message_id = 0

    @property
    def name(self) -> str:
        """Name in the rig configuration."""
        return self._name

    @property
    def range_mm(self) -> tuple[float, float]:
        """Lowest and highest z."""
        return self._range_mm

    def __enter__(self) -> Self:
        self._identity = self._open()
        return self

    def _open(self) -> DeviceIdentity:
        try:
            self._line = serial.Serial(self._port, 115200, timeout=self._reply_limit_s, exclusive=True)
        except (serial.SerialException, OSError) as error:
            raise DeviceUnavailable(self._name, f"port {self._port}: {error}") from error
        self._closing.clear()
        try:
            # The reply may still come without checksum; then the repetition brings one.
            self._ask("set comm.checksum 1")
            return self.identity()
        except BaseException:
            self._close()
            raise

    def _close(self) -> None:
        line, self._line = self._line, None
        if line is not None:
            line.close()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._closing.set()
        self._close()

    def recover(self) -> None:
        """Open the port again if it hung up; the same stage must be there.

        Raises
        ------
        DeviceUnavailable, DeviceTimeout
            Nothing is plugged in there yet, or it does not answer.
        DeviceRefused
            It is another stage.
        """
        if self._line is not None or self._closing.is_set():
            return
        found = self._open()
        if found.serial != self._identity.serial:
            self._close()
            raise DeviceRefused(
                self._name,
                f"another stage is plugged in, {found.serial} instead of {self._identity.serial}: plug the right one "
                "in, or start the server again to work with this one",
            )

    def identity(self) -> DeviceIdentity:
        """Device id, serial number and firmware version, as the stage answers."""
        model, number, version = (self._ask(f"get {key}").data for key in ("device.id", "system.serial", "version"))
        return DeviceIdentity("Zaber", model, number, version)

    def position_mm(self) -> float:
        """Actual z in mm."""
        return self._scale.z_mm(self._number("get pos"))

    def move_to(self, z_mm: float) -> float:
        """Move, wait until the stage stands, return the actual z in mm.

        Raises
        ------
        DeviceRefused
            z is outside the range, or the stage stopped with a fault.
        DeviceTimeout
            The movement did not end before its deadline; the stage is told to stop.
        """
        low_mm, high_mm = self._range_mm
        if not low_mm <= z_mm <= high_mm:
            raise DeviceRefused(self._name, f"z {z_mm:g} mm is outside the range {low_mm:g} to {high_mm:g} mm")
        if self._ask("").warning in UNREFERENCED:
            self._move("home")
        self._move(f"move abs {self._scale.counts(z_mm)}")
        return self.position_mm()

    def _move(self, command: str) -> None:
        deadline = time.monotonic() + self._move_limit_s
        self._ask("warnings clear")
        reply = self._ask(command)
        while reply.moving and not self._closing.wait(self._poll_s):
            if time.monotonic() > deadline:
                self._ask("stop")
                raise DeviceTimeout(self._name, command, self._move_limit_s)
            reply = self._ask("")
        if reply.warning.startswith("F"):
            raise DeviceRefused(self._name, f"{command!r} stopped with fault {reply.warning}")

    def _number(self, question: str) -> int:
        data = self._ask(question).data
        try:
            return int(data)
        except ValueError as error:
            raise ProtocolError(self._name, f"{question!r} answered {data!r}, not a number") from error

    def _ask(self, text: str) -> Reply:
        with self._talking:
            damaged: MessageError | None = None
            for _ in range(ATTEMPTS):
                try:
                    reply = self._exchange(text)
                except MessageError as error:
                    damaged = error
                    continue
                if reply is not None:
                    return self._accepted(text, reply)
        if damaged is not None:
            raise ProtocolError(self._name, f"{text!r}: {damaged}")
        raise DeviceTimeout(self._name, text or "status", ATTEMPTS * self._reply_limit_s)

    def _exchange(self, text: str) -> Reply | None:
        """One command and its reply; None where none came in time."""
        if self._line is None:
            raise DeviceUnavailable(self._name, "is not open")
        self._message_id = (self._message_id + 1) % 100
        command = Command(self._device, self._axis, self._message_id, text)
        try:
            self._line.reset_input_buffer()
            self._line.write(encode_command(command))
            return self._reply_to(command, self._line)
        except (serial.SerialException, OSError, termios.error, TypeError) as error:
            # pyserial reads from None, a TypeError, when another thread closes the port.
            self._close()
            reason = f"port {self._port} has hung up, as with its cable out: {error}"
            raise DeviceUnavailable(self._name, reason) from error

    def _reply_to(self, command: Command, line: serial.Serial) -> Reply | None:
        deadline = time.monotonic() + self._reply_limit_s
        while time.monotonic() < deadline:
            answer = line.read_until(b"\n")
            if not answer.endswith(b"\n"):
                return None
            reply = parse_reply(answer)
            if reply.message_id == command.message_id:
                return reply
        return None

    def _accepted(self, text: str, reply: Reply) -> Reply:
        if not reply.accepted:
            raise DeviceRefused(self._name, f"{text!r} rejected with {reply.data}")
        return reply
