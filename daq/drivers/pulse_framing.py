"""Framing of the pulse generator's lines: marks, CRC, and what a serial line may give back. Pure."""

import binascii
import re
from enum import Enum, auto

ABORT_BYTE = b"\x18"
REQUEST_MARK, REPLY_MARK = ">", "<"

_OLDER_REPLY = re.compile(r"(\?|\d+) \d+ (OK|ERR)\b")


class Heard(Enum):
    """What came instead of the reply that was waited for."""

    NOTHING = auto()
    DAMAGED = auto()
    ECHO = auto()
    OLDER = auto()


class DamagedLine(ValueError):
    """The line is not one that the generator sends."""


def framed(body: str) -> bytes:
    """Line of any body: CRC and line feed appended."""
    encoded = body.encode("ascii")
    return encoded + b"*%04X\n" % _crc16(encoded)


def is_echo(line: bytes) -> bool:
    """Whether the line begins as only a host's does: a serial line that echoes gives it back."""
    return line.startswith((REQUEST_MARK.encode(), ABORT_BYTE))


def is_older_reply(line: bytes) -> bool:
    """Whether it is a reply as firmware up to protocol 2 sends it, without a mark."""
    try:
        return _OLDER_REPLY.match(_unframed(line)) is not None
    except ValueError:
        return False


def _unframed(line: bytes) -> str:
    """Inverse of `framed`.

    Raises
    ------
    DamagedLine
        The CRC is missing or wrong.
    """
    body, star, crc = line[:-6], line[-6:-5], line[-5:]
    if star != b"*" or crc != b"%04X\n" % _crc16(body):
        raise DamagedLine(f"{line!r}: the CRC is missing or wrong")
    return body.decode("ascii")


def _crc16(body: bytes) -> int:
    """CRC-16/CCITT-FALSE."""
    return binascii.crc_hqx(body, 0xFFFF)


def words(line: bytes, mark: str) -> list[str]:
    """What stands between mark and CRC of a line; DamagedLine without that mark."""
    body = _unframed(line)
    if not body.startswith(mark):
        raise DamagedLine(f"{line!r} does not begin with {mark}")
    return body.removeprefix(mark).split(" ")


def named(fields: list[str]) -> dict[str, str]:
    """Values of NAME=VALUE by name; ValueError for anything else."""
    pairs = [field.partition("=") for field in fields]
    if not all(name and separator and value for name, separator, value in pairs):
        raise ValueError("a field is not NAME=VALUE")
    return {name: value for name, _, value in pairs}


def other_protocol(spoken: str, ours: int) -> str:
    """What is wrong with firmware of another protocol, and what to do."""
    return (
        f"speaks protocol {spoken}, this driver speaks {ours}: "
        "flash the firmware of this release (tomoshadow firmware flash)"
    )
