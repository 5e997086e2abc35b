r"""The pulse generator's protocol: bytes <-> frozen values. Pure; ``firmware/README.md`` holds the table.

::

    request   >SEQUENCE COMMAND [FIELD ...]*CRC\n
    reply     <SEQUENCE BOOT OK [NAME=VALUE ...]*CRC\n
              <SEQUENCE BOOT ERR NUMBER*CRC\n         SEQUENCE is ? where the request's could not be read
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum, IntFlag, StrEnum

from daq.drivers.pulse_framing import REPLY_MARK, REQUEST_MARK, DamagedLine, framed, named, words

PROTOCOL_VERSION = 4
CHANNEL_COUNT = 4
MAX_SEQUENCE = 65_535
HEARTBEAT_MS = 3000
MAX_DUTY_PPM = 200
UNCHANGED = 2**32 - 1  # asks for a limit without tightening it


class Command(StrEnum):
    """What the generator can be asked."""

    ID = "ID"
    NEW = "NEW"
    LIMIT = "LIMIT"
    STORE = "STORE"
    STORED = "STORED"
    CHANNEL = "CHANNEL"
    LOAD = "LOAD"
    ARM = "ARM"
    FIRE = "FIRE"
    LIGHT = "LIGHT"
    SHOT = "SHOT"
    STATUS = "STATUS"
    BEAT = "BEAT"
    OFF = "OFF"
    CLEAR = "CLEAR"


@dataclass(frozen=True)
class Fields:
    """Names of the fields of a command: positional in the request, named in the reply."""

    request: tuple[str, ...] = ()
    reply: tuple[str, ...] = ()


_EDGES = ("camera_ns", "a_start_ns", "a_width_ns", "b_start_ns", "b_width_ns", "current_ma")
_TICKS = ("camera_ticks", "a_start_ticks", "a_width_ticks", "b_start_ticks", "b_width_ticks", "current_ma")
_LIMIT_UNITS = (("max_current", "ma"), ("max_duty", "ppm"), ("max_light", "ma"))
_LIMITS = tuple(f"{kind}_{unit}" for kind, unit in _LIMIT_UNITS)
_SHOT_COUNTERS = ("requested", "fired", "suppressed", "early", "cameras", "lights")
COUNTERS = (*_SHOT_COUNTERS, "crc_errors", "framing", "breaks", "overruns", "lost")
"""Counters of STATUS, since start."""

FIELDS: Mapping[Command, Fields] = {
    Command.ID: Fields(
        reply=("model", "version", "build", "git", "serial", "protocol", "channels", "tick_ns", "cause", "last")
    ),
    Command.NEW: Fields(),
    Command.LIMIT: Fields(("channel", *_LIMITS), ("channel", *_LIMITS)),
    Command.STORE: Fields(
        tuple(f"{kind}_{i}_{unit}" for i in range(CHANNEL_COUNT) for kind, unit in _LIMIT_UNITS), ("stored",)
    ),
    Command.STORED: Fields(("channel",), ("stored", "channel", *_LIMITS)),
    Command.CHANNEL: Fields(("channel", *_EDGES, "frame_a_close_ns", "frame_b_open_ns"), ("channel", *_EDGES)),
    Command.LOAD: Fields(reply=("train", "length_ns", "period_us")),
    Command.ARM: Fields(("shots", "source", "period_us"), ("train", "shots_left")),
    Command.FIRE: Fields(reply=("fired", "train", "shots_left")),
    Command.LIGHT: Fields(("time_ms", *(f"current_{i}_ma" for i in range(CHANNEL_COUNT))), ("state",)),
    Command.SHOT: Fields(("channel",), ("fired", "channel", *_TICKS)),
    Command.STATUS: Fields(reply=("state", "faults", "interlock", "estop", "source", "shots_left", *COUNTERS)),
    Command.BEAT: Fields(reply=("state",)),
    Command.OFF: Fields(reply=("state",)),
    Command.CLEAR: Fields(reply=("state",)),
}


class State(IntEnum):
    """State of the generator."""

    SAFE = 0
    ARMED = 1
    FAULT = 2
    LIT = 3


class Stored(IntEnum):
    """What the board has found of the limits that it keeps over a start."""

    NONE = 0
    WHOLE = 1
    DAMAGED = 2


class Source(IntEnum):
    """What starts the shots of an armed generator."""

    COMMAND = 0
    EXTERNAL = 1
    TIMER = 2


class Cause(IntEnum):
    """Why the microcontroller has started."""

    UNKNOWN = 0
    POWER = 1
    PIN = 2
    DEBUG = 3
    WATCHDOG = 4
    SOFTWARE = 5


class Fault(IntFlag):
    """Latched causes of the state FAULT."""

    INTERLOCK = 1
    HEARTBEAT = 2
    WATCHDOG = 4
    INTERNAL = 8
    ESTOP = 16
    SETPOINT = 32
    OUTPUT = 64
    LIMITS = 128
    CLOCK = 256


class ErrorNumber(IntEnum):
    """Numbers of the errors; ``ERROR_TEXT`` says them in words."""

    CRC = 1
    LINE_TOO_LONG = 2
    UNKNOWN_COMMAND = 3
    SYNTAX = 4
    SEQUENCE = 5
    NOT_SAFE = 6
    NOT_ARMED = 7
    FAULT_LATCHED = 8
    INTERLOCK_OPEN = 9
    EARLY = 10
    NO_TRAIN = 11
    CHANNEL = 12
    WIDTH = 13
    SEPARATION = 14
    EDGE = 15
    CURRENT = 16
    STRADDLE = 17
    SHOTS = 18
    HARDWARE = 19
    LIMIT = 20
    LIGHT = 21
    ESTOP_OPEN = 22
    SOURCE = 23
    PERIOD = 24
    OTHER_SOURCE = 25
    NO_SHOT = 26
    STORE = 27


ERROR_TEXT: Mapping[ErrorNumber, str] = {
    ErrorNumber.CRC: "the line arrived damaged",
    ErrorNumber.LINE_TOO_LONG: "the line is longer than 128 characters",
    ErrorNumber.UNKNOWN_COMMAND: "there is no such command",
    ErrorNumber.SYNTAX: "a field is missing, superfluous or no number",
    ErrorNumber.SEQUENCE: "the sequence number was used for another line",
    ErrorNumber.NOT_SAFE: "the generator is armed or lit; switch it off first",
    ErrorNumber.NOT_ARMED: "the generator is not armed",
    ErrorNumber.FAULT_LATCHED: "a fault is latched; clear it first",
    ErrorNumber.INTERLOCK_OPEN: "the generator's interlock is open",
    ErrorNumber.EARLY: "it came before the shortest period was over; there was no light",
    ErrorNumber.NO_TRAIN: "no pulse train is loaded",
    ErrorNumber.CHANNEL: "there is no such channel",
    ErrorNumber.WIDTH: "a pulse is shorter than 200 ns or longer than 2000 ns",
    ErrorNumber.SEPARATION: "pulse B starts less than 400 ns after the end of A or more than 200000 ns after its start",
    ErrorNumber.EDGE: "an edge is later than 20000000 ns after the trigger",
    ErrorNumber.CURRENT: "the current is above 30000 mA",
    ErrorNumber.STRADDLE: "pulse A ends after frame A closes, or pulse B starts before frame B opens",
    ErrorNumber.SHOTS: "the shot budget is not 1 to 1000000",
    ErrorNumber.HARDWARE: "the hardware cannot produce this, or something in it does not read as it should",
    ErrorNumber.LIMIT: "the current is above the limit that was set for this channel, or its light was forbidden",
    ErrorNumber.LIGHT: "continuous light is not 10 to 500 mA on any channel, or not for 1 to 600000 ms",
    ErrorNumber.ESTOP_OPEN: "the emergency stop is open",
    ErrorNumber.SOURCE: "there is no such trigger source",
    ErrorNumber.PERIOD: "the period is shorter than the train permits, or longer than 10000000 us",
    ErrorNumber.OTHER_SOURCE: "the generator is armed for another trigger source",
    ErrorNumber.NO_SHOT: "no shot of this train has been fired on this channel",
    ErrorNumber.STORE: "a limit to be stored is above 30000 mA, 200 ppm or 500 mA of continuous light",
}


@dataclass(frozen=True)
class Request:
    """One line to the generator."""

    sequence: int
    command: Command
    fields: tuple[int, ...] = ()


@dataclass(frozen=True)
class Reply:
    """One line from the generator.

    Parameters
    ----------
    sequence : int | None
        Number of the request; None where the generator could not read it.
    boot : int
        How often the microcontroller has started; a change means that it was reset.
    error : ErrorNumber | None
        Why it refused; None where it did not.
    fields : Mapping[str, str]
        Values by name.
    """

    sequence: int | None
    boot: int
    error: ErrorNumber | None = None
    fields: Mapping[str, str] = field(default_factory=dict)

    def number(self, name: str) -> int:
        """Value of a numeric field."""
        return int(self.fields[name])


def encode_request(request: Request) -> bytes:
    """Line of a request.

    Raises
    ------
    ValueError
        The number of fields is not that of the command, or a value does not fit.
    """
    if not 0 <= request.sequence <= MAX_SEQUENCE:
        raise ValueError(f"sequence number {request.sequence} is not within 0 to {MAX_SEQUENCE}")
    names = FIELDS[request.command].request
    if len(request.fields) != len(names):
        raise ValueError(f"{request.command}: {len(request.fields)} fields given, wants {', '.join(names) or 'none'}")
    for name, value in zip(names, request.fields, strict=True):
        if not 0 <= value < 2**32:
            raise ValueError(f"{request.command}: {name} is {value}, not within 0 to {2**32 - 1}")
    return framed(" ".join((f"{REQUEST_MARK}{request.sequence}", request.command, *map(str, request.fields))))


def decode_request(line: bytes) -> Request:
    """Inverse of `encode_request`.

    Raises
    ------
    DamagedLine
        It is no such line.
    """
    sequence, command, *fields = words(line, REQUEST_MARK)
    try:
        request = Request(int(sequence), Command(command), tuple(map(int, fields)))
        if encode_request(request) == line:
            return request
    except ValueError as error:
        raise DamagedLine(f"{line!r}: {error}") from error
    raise DamagedLine(f"{line!r} is not written as the protocol writes it")


def decode_reply(line: bytes) -> Reply:
    """Reply of a line, its line feed included.

    Raises
    ------
    DamagedLine
        CRC or form is wrong.
    """
    try:
        sequence, boot, verdict, *rest = words(line, REPLY_MARK)
        number = None if sequence == "?" else int(sequence)
        if verdict == "OK":
            return Reply(number, int(boot), fields=named(rest))
        if verdict == "ERR" and len(rest) == 1:
            return Reply(number, int(boot), ErrorNumber(int(rest[0])))
    except ValueError as error:
        raise DamagedLine(f"{line!r}: {error}") from error
    raise DamagedLine(f"{line!r} is neither OK nor ERR")


def encode_reply(reply: Reply) -> bytes:
    """Inverse of `decode_reply`."""
    head = f"{REPLY_MARK}{'?' if reply.sequence is None else reply.sequence} {reply.boot}"
    if reply.error is not None:
        return framed(f"{head} ERR {reply.error.value}")
    return framed(" ".join([head, "OK", *(f"{name}={value}" for name, value in reply.fields.items())]))
