"""Firmware image: a UF2 file that is checked before it may go to a board, and the drive of a board that waits for one.

UF2 format: https://github.com/microsoft/uf2; RP2040 boot ROM: RP2040 data sheet, sections 2.8.1.3.1 and 2.8.5.
"""

import os
import re
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from daq.errors import DeviceError, DeviceUnavailable
from processing.errors import BadInput

BLOCK_BYTES = 512
FIRST_MAGIC, SECOND_MAGIC, LAST_MAGIC = 0x0A324655, 0x9E5D5157, 0x0AB16F30
FAMILY_FLAG, RP2040_FAMILY = 0x2000, 0xE48BFF56
FLASH_START, FLASH_END = 0x1000_0000, 0x1020_0000
BOOT_BYTES = 256
MOUNT_ROOTS = (Path("/media"), Path("/run/media"), Path("/mnt"))
_INFO_FILE = "INFO_UF2.TXT"
_HEADER = struct.Struct("<8I")
_PAYLOAD_BYTES = 256
_IDENTITY = re.compile(rb"model=tomoshadow-pulse version=([0-9.]+)")
_DEVICE = "pulse generator's drive"


class ImageError(BadInput):
    """The file is no firmware image of the pulse generator; names file and block."""


@dataclass(frozen=True)
class FirmwareImage:
    """A checked image.

    Parameters
    ----------
    path : Path
        UF2 file.
    version : str
        Version of the firmware in it.
    blocks : int
        UF2 blocks of 512 bytes, each with 256 bytes for the flash.
    """

    path: Path
    version: str
    blocks: int


def load_image(path: Path) -> FirmwareImage:
    """Check a UF2 file: format, family, addresses, CRC of the boot stage, and that it is this product.

    Raises
    ------
    ImageError
        It fails one of the checks; the text says which, and where.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise ImageError(f"{path}: {error.strerror}") from error
    if not content or len(content) % BLOCK_BYTES:
        raise ImageError(f"{path}: {len(content)} bytes are not a whole number of UF2 blocks of {BLOCK_BYTES}")
    blocks = [content[start : start + BLOCK_BYTES] for start in range(0, len(content), BLOCK_BYTES)]
    flash = b"".join(_payload(path, number, len(blocks), block) for number, block in enumerate(blocks))
    _check_boot_stage(path, flash)
    identity = _IDENTITY.search(flash)
    if identity is None:
        raise ImageError(f"{path}: a program for the RP2040, but not the firmware of the pulse generator")
    return FirmwareImage(path, identity[1].decode(), len(blocks))


def _payload(path: Path, number: int, count: int, block: bytes) -> bytes:
    first, second, flags, address, size, stated_number, stated_count, family = _HEADER.unpack_from(block)
    (last,) = struct.unpack_from("<I", block, BLOCK_BYTES - 4)
    where = f"{path}: block {number}"
    if (first, second, last) != (FIRST_MAGIC, SECOND_MAGIC, LAST_MAGIC):
        raise ImageError(f"{where}: no UF2 block: magic numbers {first:#010x} {second:#010x} {last:#010x}")
    if not flags & FAMILY_FLAG or family != RP2040_FAMILY:
        raise ImageError(f"{where}: for family {family:#010x}, not for the RP2040 ({RP2040_FAMILY:#010x})")
    if (stated_number, stated_count) != (number, count):
        raise ImageError(f"{where}: says it is block {stated_number} of {stated_count}, the file has {count}")
    if size != _PAYLOAD_BYTES or address != FLASH_START + number * _PAYLOAD_BYTES or address >= FLASH_END:
        raise ImageError(
            f"{where}: {size} bytes for address {address:#010x}; the image must fill the flash from its start"
        )
    return block[_HEADER.size : _HEADER.size + size]


def _check_boot_stage(path: Path, flash: bytes) -> None:
    """The boot ROM starts a program only if the last word of its first 256 bytes is the CRC of the others."""
    (stated,) = struct.unpack_from("<I", flash, BOOT_BYTES - 4)
    computed = crc32_of_boot_rom(flash[: BOOT_BYTES - 4])
    if stated != computed:
        raise ImageError(f"{path}: CRC of the boot stage is {computed:#010x}, the file says {stated:#010x}")


def crc32_of_boot_rom(data: bytes) -> int:
    """CRC-32 of the RP2040's boot ROM: polynomial 0x04C11DB7, start 0xFFFFFFFF, nothing reflected or inverted."""
    crc = 0xFFFF_FFFF
    for byte in data:
        crc ^= byte << 24
        for _ in range(8):
            crc = (crc << 1 ^ 0x04C1_1DB7 if crc & 0x8000_0000 else crc << 1) & 0xFFFF_FFFF
    return crc


def find_drive(given: Path | None = None, roots: Sequence[Path] = MOUNT_ROOTS) -> Path:
    """Drive of a board that waits for an image: the given one, or the only one that is mounted.

    Raises
    ------
    DeviceUnavailable
        There is none, there are several, or the given one is something else.
    """
    if given is not None:
        _check_board(given)
        return given
    found = sorted(
        info.parent for root in roots for depth in ("*", "*/*") for info in root.glob(f"{depth}/{_INFO_FILE}")
    )
    if not found:
        places = ", ".join(map(str, roots))
        raise DeviceUnavailable(
            _DEVICE,
            f"no {_INFO_FILE} below {places}: hold BOOTSEL while plugging the board in, mount the drive RPI-RP2, "
            f"or name it by --drive",
        )
    if len(found) > 1:
        raise DeviceUnavailable(_DEVICE, f"several are mounted ({', '.join(map(str, found))}): name one by --drive")
    _check_board(found[0])
    return found[0]


def _check_board(drive: Path) -> None:
    try:
        info = (drive / _INFO_FILE).read_text(encoding="ascii", errors="replace")
    except OSError as error:
        raise DeviceUnavailable(_DEVICE, f"{drive} is no UF2 drive: {_INFO_FILE}: {error.strerror}") from error
    board = re.search(r"^Board-ID:\s*(\S+)", info, re.MULTILINE)
    if board is None or board[1] != "RPI-RP2":
        raise DeviceUnavailable(_DEVICE, f"{drive} belongs to board {board[1] if board else '?'}, not to an RPI-RP2")


def write_image(image: FirmwareImage, drive: Path) -> Path:
    """Copy an image to the drive of a board, which then starts it and takes its drive away.

    Raises
    ------
    DeviceError
        The drive refused the image.
    """
    target = drive / image.path.name
    content = image.path.read_bytes()
    written = 0
    try:
        with target.open("wb", buffering=0) as file:
            written = file.write(content)
            os.fsync(file.fileno())
    except OSError as error:
        # A board that has all its blocks restarts at once, often before the computer has closed the file.
        if written < len(content) or (drive / _INFO_FILE).exists():
            raise DeviceError(_DEVICE, f"{target}: {written} of {len(content)} bytes written: {error}") from error
    return target
