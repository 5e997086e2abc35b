"""Zaber's ASCII protocol for motorised stages: pure bytes, with message ids and checksums.

A command is ``/01 1 07 move abs 1000:5C``, its reply ``@01 1 07 OK BUSY -- 0:8A``: device, axis, message
id, then for replies flag, status, warning and data. The two digits after the colon make the sum of all
bytes from after the first character up to the colon, plus themselves, zero modulo 256.
(Zaber, ASCII Protocol Manual, "Message Format" and "Checksum".)
"""

from dataclasses import dataclass


class MessageError(ValueError):
    """The bytes are no message of this protocol, or were damaged on the line."""


@dataclass(frozen=True)
class Command:
    """What the host asks of one axis; an empty text asks for the status only."""

    device: int
    axis: int
    message_id: int
    text: str


@dataclass(frozen=True)
class Reply:
    """Answer to the command with the same message id.

    Parameters
    ----------
    accepted : bool
        OK or RJ; ``data`` of a rejected command is the reason, for example ``BADDATA``.
    moving : bool
        Status BUSY or IDLE.
    warning : str
        Highest warning flag: ``--`` for none, ``WR`` and ``WH`` without reference position, ``F?`` for faults.
    """

    device: int
    axis: int
    message_id: int
    accepted: bool
    moving: bool
    warning: str
    data: str


def checksum(body: str) -> int:
    """Longitudinal redundancy check of everything between the first character and the colon."""
    return -sum(body.encode("ascii")) & 0xFF


def encode_command(command: Command) -> bytes:
    """Line of bytes, end of line included."""
    text = f" {command.text}" if command.text else ""
    return _seal("/", f"{command.device:02d} {command.axis} {command.message_id:02d}{text}", "\n")


def encode_reply(reply: Reply) -> bytes:
    """Line of bytes, end of line included."""
    flag, status = ("OK" if reply.accepted else "RJ"), ("BUSY" if reply.moving else "IDLE")
    address = f"{reply.device:02d} {reply.axis} {reply.message_id:02d}"
    return _seal("@", f"{address} {flag} {status} {reply.warning} {reply.data}", "\r\n")


def parse_command(line: bytes) -> Command:
    """Read a command.

    Raises
    ------
    MessageError
        Wrong first character, fields or checksum.
    """
    fields = _unseal("/", line).split(" ", 3)
    if len(fields) < 3:
        raise MessageError(f"command {line!r} has no message id")
    device, axis, message_id = _numbers(fields[:3], line)
    return Command(device, axis, message_id, fields[3] if len(fields) == 4 else "")


def parse_reply(line: bytes) -> Reply:
    """Read a reply.

    Raises
    ------
    MessageError
        Wrong first character, fields or checksum.
    """
    fields = _unseal("@", line).split(" ", 6)
    if len(fields) != 7 or fields[3] not in ("OK", "RJ") or fields[4] not in ("BUSY", "IDLE"):
        raise MessageError(f"reply {line!r} lacks fields")
    device, axis, message_id = _numbers(fields[:3], line)
    return Reply(device, axis, message_id, fields[3] == "OK", fields[4] == "BUSY", fields[5], fields[6])


def _seal(kind: str, body: str, end: str) -> bytes:
    return f"{kind}{body}:{checksum(body):02X}{end}".encode("ascii")


def _unseal(kind: str, line: bytes) -> str:
    try:
        text = line.decode("ascii").rstrip("\r\n")
    except UnicodeDecodeError as error:
        raise MessageError(f"{line!r} is not ASCII") from error
    body, colon, digits = text[1:].rpartition(":")
    if not text.startswith(kind) or not colon or digits != f"{checksum(body):02X}":
        raise MessageError(f"{line!r}: damaged, or without checksum")
    return body


def _numbers(fields: list[str], line: bytes) -> list[int]:
    if not all(field.isdigit() for field in fields):
        raise MessageError(f"{line!r}: address and message id must be numbers")
    return [int(field) for field in fields]
