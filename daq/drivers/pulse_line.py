"""The serial line of the pulse generator: numbered requests, repeated until answered or too late."""

import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager

import serial

from daq.drivers.pulse_framing import ABORT_BYTE, DamagedLine, Heard, is_echo, is_older_reply, other_protocol
from daq.drivers.pulse_protocol import (
    ERROR_TEXT,
    FIELDS,
    MAX_SEQUENCE,
    PROTOCOL_VERSION,
    Command,
    Reply,
    Request,
    decode_reply,
    encode_request,
)
from daq.errors import (
    DeviceError,
    DeviceOvertaken,
    DeviceRefused,
    DeviceTimeout,
    DeviceUnavailable,
    ProtocolError,
)

LIMIT_S = 1.0
OPENING_LIMIT_S = 3.0
_REPEAT_S = 0.2
_REPEAT_DAMAGED_S = 0.02
_SLICE_S = 0.02
_WRITE_LIMIT_S = 0.5
_BAUD = 115_200
_LONGEST_LINE = 512


class PulseLine:
    """Asks one generator, one question at a time; ``off`` overtakes every question that was asked before it.

    Parameters
    ----------
    name : str
        Name of the device, for errors.
    port : str
        Path of the serial port.
    clock_s : Callable[[], float]
        The generator's time, in which it has to answer. A simulated one can be slower than the clock on the wall.
    """

    def __init__(self, name: str, port: str, clock_s: Callable[[], float] = time.monotonic) -> None:
        self._name = name
        self._path = port
        self._clock_s = clock_s
        self._port: serial.Serial | None = None
        self._hung_up = False
        self._asking = threading.Lock()
        self._last_off = object()  # another one before and after each abort byte
        self._sequence = 0
        self._boot = 0
        self.restarts = 0  # of the microcontroller, or of its port, as far as they were found out
        self._received = b""

    def open(self) -> Reply:
        """Take the port for this process alone, end whatever was going on, and return the generator's identity."""
        with self._translated_errors():
            # Opening alone raises DTR and RTS, which pyserial skips on a pseudo-terminal; nothing here touches them.
            self._port = serial.Serial(
                self._path, _BAUD, timeout=_SLICE_S, write_timeout=_WRITE_LIMIT_S, exclusive=True
            )
        self._hung_up, self._received = False, b""
        try:
            self._write(ABORT_BYTE + b"\n", Command.ID, OPENING_LIMIT_S)
            return self._open_session()
        except DeviceError:
            self.close()
            raise

    def reopen(self) -> Reply:
        """Open the port anew: there may be another device at its path. Waits for whoever still asks."""
        with self._alone("open"):
            self.close()
            self.restarts += 1
            return self.open()

    @property
    def is_lost(self) -> bool:
        """The port hung up, or is closed."""
        return self._hung_up or self._port is None

    def _open_session(self) -> Reply:
        identity = self._converse(Request(0, Command.ID), OPENING_LIMIT_S, last_off=None)
        spoken = identity.fields.get("protocol")
        if spoken is not None and spoken != str(PROTOCOL_VERSION):
            raise ProtocolError(self._name, other_protocol(spoken, PROTOCOL_VERSION))
        self._check_fields(Command.ID, identity)
        self._sequence = identity.number("last")
        self._boot = identity.boot
        return identity

    @property
    def name(self) -> str:
        """Name of the device."""
        return self._name

    @property
    def now_s(self) -> float:
        """The generator's time."""
        return self._clock_s()

    def close(self) -> None:
        """Give the port back; safe to call twice."""
        port, self._port = self._port, None
        if port is not None:
            port.close()

    def ask(self, command: Command, *fields: int) -> Reply:
        """Answer to one command.

        Raises
        ------
        DeviceRefused
            The generator answered with a numbered error.
        DeviceTimeout, ProtocolError
            It answered nothing, or only damaged lines, within ``LIMIT_S``.
        DeviceUnavailable
            The port hung up.
        DeviceError
            The microcontroller was reset since the last answer, or `off` overtook the command.
        """
        reply = self.answer(command, *fields)
        if reply.error is not None:
            text = ERROR_TEXT[reply.error]
            raise DeviceRefused(self._name, f"{command} refused: {text} (error {reply.error.value})")
        return reply

    def answer(self, command: Command, *fields: int) -> Reply:
        """Like `ask`, but a refusal is an answer, not an error."""
        last_off = self._last_off
        with self._alone(command):
            reply = self._converse(self._numbered(command, fields), LIMIT_S, last_off)
            self._check_boot(reply)
        return reply

    def exchange(self, line: bytes) -> Reply:
        """Send a line once and as it is, damaged or not, and return the next reply; for the self-test."""
        what = repr(line)
        deadline_s = self._clock_s() + LIMIT_S
        with self._alone(what):
            self._write(line, what, LIMIT_S)
            while self._clock_s() < deadline_s:
                received = self._next_line()
                if received is not None and not is_echo(received):
                    return self._decoded(received)
        raise DeviceTimeout(self._name, what, LIMIT_S)

    def _decoded(self, line: bytes) -> Reply:
        try:
            return decode_reply(line)
        except DamagedLine as error:
            raise ProtocolError(self._name, str(error)) from error

    def off(self) -> Reply:
        """Send the abort byte past everybody who waits, then ask for confirmation."""
        self._last_off = object()
        self._write(ABORT_BYTE, Command.OFF, _WRITE_LIMIT_S)
        self._last_off = object()
        with self._alone(Command.OFF):
            reply = self._converse(self._numbered(Command.OFF, ()), LIMIT_S, last_off=None)
            self._has_restarted(reply)
        return reply

    @contextmanager
    def _alone(self, command: str) -> Iterator[None]:
        deadline_s = self._clock_s() + 2 * LIMIT_S
        while not self._asking.acquire(timeout=_SLICE_S):
            if self._clock_s() >= deadline_s:
                raise DeviceTimeout(self._name, str(command), 2 * LIMIT_S)
        try:
            yield
        finally:
            self._asking.release()

    def _numbered(self, command: Command, fields: tuple[int, ...]) -> Request:
        self._sequence = self._sequence % MAX_SEQUENCE + 1
        return Request(self._sequence, command, fields)

    def _converse(self, request: Request, limit_s: float, last_off: object | None) -> Reply:
        """Send until answered, and after an abort byte, for which the board forgets lines; it does each only once."""
        deadline_s = self._clock_s() + limit_s
        heard: Counter[Heard] = Counter()
        while self._clock_s() < deadline_s:
            self._check_not_overtaken(request.command, last_off)
            sent_after = self._last_off
            self._write(encode_request(request), request.command, limit_s)
            repeat_s = min(deadline_s, self._clock_s() + _REPEAT_S)
            while self._clock_s() < repeat_s and self._last_off is sent_after:
                self._check_not_overtaken(request.command, last_off)
                reply = self._next_reply(request)
                if isinstance(reply, Reply):
                    return reply
                heard[reply] += 1
                if reply is Heard.DAMAGED:
                    repeat_s = min(repeat_s, self._clock_s() + _REPEAT_DAMAGED_S)
        self._explain_silence(request.command, heard)
        raise DeviceTimeout(self._name, request.command.value, limit_s)

    def _explain_silence(self, command: Command, heard: Mapping[Heard, int]) -> None:
        if heard[Heard.OLDER]:
            raise ProtocolError(self._name, other_protocol("2 or older", PROTOCOL_VERSION))
        if heard[Heard.DAMAGED]:
            raise ProtocolError(self._name, f"only damaged lines ({heard[Heard.DAMAGED]}) in answer to {command}")
        if heard[Heard.ECHO]:
            raise ProtocolError(
                self._name, f"{self._path} gives back what is sent, {command} among it, and nobody answers: an echo"
            )

    def _next_reply(self, request: Request) -> Reply | Heard:
        """Reply to this request; one to another is NOTHING, one that cannot be read, here or there, is DAMAGED."""
        line = self._next_line()
        if line is None:
            return Heard.NOTHING
        if is_echo(line):
            return Heard.ECHO
        if is_older_reply(line):
            return Heard.OLDER
        try:
            reply = decode_reply(line)
        except DamagedLine:
            return Heard.DAMAGED
        if reply.sequence is None:
            return Heard.DAMAGED
        if reply.sequence != request.sequence:
            return Heard.NOTHING
        if request.command is not Command.ID:  # another protocol may answer it with other fields
            self._check_fields(request.command, reply)
        return reply

    def _check_fields(self, command: Command, reply: Reply) -> None:
        if reply.error is None and set(reply.fields) != set(FIELDS[command].reply):
            raise ProtocolError(self._name, f"answered {command} with fields {sorted(reply.fields)}")

    def _next_line(self) -> bytes | None:
        """Next complete line; None if none is complete after a short wait."""
        if b"\n" not in self._received:
            with self._translated_errors():
                port = self._opened()
                self._received += port.read(1)
                self._received += port.read(port.in_waiting)
        line, end, rest = self._received.partition(b"\n")
        if end:
            self._received = rest
            return line + end
        self._received = line[-_LONGEST_LINE:]
        return None

    def _write(self, encoded: bytes, command: str, limit_s: float) -> None:
        try:
            with self._translated_errors():
                self._opened().write(encoded)
        except serial.SerialTimeoutException as error:
            raise DeviceTimeout(self._name, str(command), limit_s) from error

    def _opened(self) -> serial.Serial:
        port = self._port
        if port is None:
            raise DeviceUnavailable(self._name, f"{self._path} is not open")
        return port

    @contextmanager
    def _translated_errors(self) -> Iterator[None]:
        try:
            yield
        except serial.SerialTimeoutException:
            raise
        except OSError as error:
            self._hung_up = self._port is not None
            what = " has hung up, as with its cable out" if self._hung_up else ""
            raise DeviceUnavailable(self._name, f"{self._path}{what}: {error}") from error

    def _check_not_overtaken(self, command: Command, last_off: object | None) -> None:
        if last_off is not None and last_off is not self._last_off:
            raise DeviceOvertaken(self._name, f"{command} was overtaken by off")

    def _check_boot(self, reply: Reply) -> None:
        before = self._boot
        if self._has_restarted(reply):
            raise DeviceError(
                self._name,
                f"the microcontroller was reset (start {reply.boot}, was {before}); light is off, nothing is loaded",
            )

    def _has_restarted(self, reply: Reply) -> bool:
        before, self._boot = self._boot, reply.boot
        self.restarts += reply.boot != before
        return reply.boot != before
