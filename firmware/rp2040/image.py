"""Linked image -> UF2 for the drive of the boot ROM.

    image.py IMAGE.bin IMAGE.uf2
    image.py erase-limits.uf2

Puts the CRC of the second boot stage into the image (RP2040 data sheet, 2.8.1.3.1), in place, and the sums of its two
other parts, which the firmware checks (boot/start.c); then wraps the image into UF2 blocks
(https://github.com/microsoft/uf2). The same image gives the same bytes.

The second form is for a board whose limits are to be forgotten: blank pages in the place of chip/flash_records.c.
"""

import struct
import sys
from pathlib import Path

FLASH = 0x1000_0000
BOOT2_SIZE = 256
PAGE = 256
LIMITS_AT, LIMITS_SIZE = 0x1_0000, 4096
FAMILY_RP2040 = 0xE48B_FF56
FAMILY_PRESENT = 0x2000
BLOCK = struct.Struct("<8I476sI")
MAGICS = (0x0A32_4655, 0x9E5D_5157, 0x0AB1_6F30)


def crc32_of_boot_rom(data: bytes) -> int:
    """CRC-32/MPEG-2: polynomial 04C11DB7, not reflected, start at all ones."""
    crc = 0xFFFF_FFFF
    for byte in data:
        crc ^= byte << 24
        for _ in range(8):
            crc = (crc << 1 ^ (0x04C1_1DB7 if crc & 0x8000_0000 else 0)) & 0xFFFF_FFFF
    return crc


def with_boot_crc(image: bytes) -> bytes:
    """The image with the CRC behind its second boot stage, whose last word must be free."""
    boot2, crc = image[: BOOT2_SIZE - 4], image[BOOT2_SIZE - 4 : BOOT2_SIZE]
    if any(crc):
        raise ValueError(f"the second boot stage is larger than {BOOT2_SIZE - 4} bytes")
    return boot2 + struct.pack("<I", crc32_of_boot_rom(boot2)) + image[BOOT2_SIZE:]


def checksum(words: bytes) -> int:
    """Sum over words of chip/checksum.h."""
    total = 0x746F_6D6F
    for (word,) in struct.iter_unpack("<I", words):
        mixed = (total ^ word) * 0x9E37_79B1 & 0xFFFF_FFFF
        total = (mixed >> 13 | mixed << 19) & 0xFFFF_FFFF
    return total


def with_sums(image: bytes) -> bytes:
    """The image with a sum as the last word of each part: what runs in flash, and what is copied into RAM.

    The third word behind the boot stage says where the copy starts.
    """
    (address,) = struct.unpack_from("<I", image, BOOT2_SIZE + 8)
    parts = (image[:BOOT2_SIZE], image[BOOT2_SIZE : address - FLASH], image[address - FLASH :])
    return parts[0] + b"".join(part[:-4] + struct.pack("<I", checksum(part[:-4])) for part in parts[1:])


def uf2(image: bytes, offset: int = 0) -> bytes:
    """One block of 512 bytes per flash page; the last page is filled with zeros."""
    pages = [image[start : start + PAGE].ljust(PAGE, b"\0") for start in range(0, len(image), PAGE)]
    start_magic, second_magic, end_magic = MAGICS
    return b"".join(
        BLOCK.pack(
            start_magic,
            second_magic,
            FAMILY_PRESENT,
            FLASH + offset + PAGE * i,
            PAGE,
            i,
            len(pages),
            FAMILY_RP2040,
            page,
            end_magic,
        )
        for i, page in enumerate(pages)
    )


def main() -> None:
    *binaries, drive_file = map(Path, sys.argv[1:])
    if not binaries:
        drive_file.write_bytes(uf2(b"\xff" * LIMITS_SIZE, LIMITS_AT))
        return
    binary = binaries[0]
    image = with_sums(with_boot_crc(binary.read_bytes()))
    binary.write_bytes(image)
    drive_file.write_bytes(uf2(image))


if __name__ == "__main__":
    main()
