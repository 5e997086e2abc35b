"""Framing of the pulse generator's lines: marks, CRC, and what a serial line may give back. Pure."""

import binascii
import re

ABORT_BYTE = b"\x18"
REQUEST_MARK, REPLY_MARK = ">", "<"

_OLDER_REPLY = re.compile(r"(\?|\d+) \d+ (OK|ERR)\b")


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
        return _OLDER_REPLY.match(unframed(line)) is not None
    except ValueError:
        return False


def unframed(line: bytes) -> str:
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
