"""Only the pulse generator's own image goes to a board, and only to the right board."""

import errno
import re
import struct
from collections.abc import Callable
from pathlib import Path

import pytest

from daq.errors import DeviceError, DeviceUnavailable
from daq.simulation.pico.firmware_build import ImageKind, build_image
from server.rig.firmware_image import (
    BOOT_BYTES,
    FAMILY_FLAG,
    FIRST_MAGIC,
    FLASH_START,
    LAST_MAGIC,
    RP2040_FAMILY,
    SECOND_MAGIC,
    ImageError,
    crc32_of_boot_rom,
    find_drive,
    load_image,
    write_image,
)

PROGRAM = b"firmware... model=tomoshadow-pulse version=1.2.3 build=rp2040".ljust(512, b"\0")


def uf2(flash: bytes, family: int = RP2040_FAMILY, first_address: int = FLASH_START) -> bytes:
    parts = [flash[start : start + 256].ljust(256, b"\0") for start in range(0, len(flash), 256)]
    blocks = []
    for number, part in enumerate(parts):
        address = first_address + 256 * number
        head = struct.pack("<8I", FIRST_MAGIC, SECOND_MAGIC, FAMILY_FLAG, address, 256, number, len(parts), family)
        blocks.append(head + part.ljust(476, b"\0") + struct.pack("<I", LAST_MAGIC))
    return b"".join(blocks)


def bootable(program: bytes = PROGRAM) -> bytes:
    boot = bytes(range(252))
    return boot + struct.pack("<I", crc32_of_boot_rom(boot)) + program


def changed(content: bytes, at: int, value: int) -> bytes:
    return content[:at] + bytes([value]) + content[at + 1 :]


@pytest.fixture
def drive(tmp_path: Path) -> Path:
    return mounted(tmp_path / "media" / "user" / "RPI-RP2")


def mounted(folder: Path, board: str = "RPI-RP2") -> Path:
    folder.mkdir(parents=True)
    (folder / "INFO_UF2.TXT").write_text(f"UF2 Bootloader v2.0\r\nModel: Raspberry Pi RP2\r\nBoard-ID: {board}\r\n")
    return folder


def saved(tmp_path: Path, content: bytes) -> Path:
    path = tmp_path / "pulse.uf2"
    path.write_bytes(content)
    return path


def test_crc_has_the_check_value_of_crc32_mpeg2() -> None:
    assert crc32_of_boot_rom(b"123456789") == 0x0376E6E7


def test_a_good_image_tells_its_version(tmp_path: Path) -> None:
    image = load_image(saved(tmp_path, uf2(bootable())))
    assert (image.version, image.blocks) == ("1.2.3", (BOOT_BYTES + len(PROGRAM)) // 256)


@pytest.mark.parametrize("kind", ImageKind)
def test_the_images_that_are_built_here_may_be_flashed(kind: ImageKind) -> None:
    image = load_image(build_image(kind=kind).with_suffix(".uf2"))
    assert image.version == re.search(r'VERSION "([0-9.]+)"', Path("firmware/core/commands.h").read_text())[1]  # type: ignore[index]


SPOILT: dict[str, tuple[Callable[[], bytes], str]] = {
    "empty": (lambda: b"", "0 bytes"),
    "cut": (lambda: uf2(bootable())[:-1], "whole number of UF2 blocks"),
    "block missing": (lambda: uf2(bootable())[512:], "block 0: says it is block 1 of 3"),
    "no UF2": (lambda: changed(uf2(bootable()), 512, 0), "block 1: no UF2 block"),
    "end mark": (lambda: changed(uf2(bootable()), 511, 0), "block 0: no UF2 block"),
    "other family": (lambda: uf2(bootable(), family=0xE48BFF59), "block 0: for family 0xe48bff59"),
    "for RAM": (lambda: uf2(bootable(), first_address=0x2000_0000), "block 0: 256 bytes for address 0x20000000"),
    "bit in the boot stage": (lambda: changed(uf2(bootable()), 40, 0xFF), "CRC of the boot stage"),
    "other program": (lambda: uf2(bootable(b"blink".ljust(256, b"\0"))), "not the firmware of the pulse generator"),
}


@pytest.mark.parametrize(("spoil", "reason"), SPOILT.values(), ids=SPOILT.keys())
def test_anything_else_is_refused_with_its_reason(tmp_path: Path, spoil: Callable[[], bytes], reason: str) -> None:
    with pytest.raises(ImageError, match=f"pulse.uf2.*{reason}"):
        load_image(saved(tmp_path, spoil()))


def test_an_absent_image_is_named(tmp_path: Path) -> None:
    with pytest.raises(ImageError, match=r"absent\.uf2: No such file"):
        load_image(tmp_path / "absent.uf2")


def test_the_only_mounted_board_is_found(tmp_path: Path, drive: Path) -> None:
    assert find_drive(roots=[tmp_path / "media", tmp_path / "absent"]) == drive


def test_no_board_tells_what_to_do(tmp_path: Path) -> None:
    with pytest.raises(DeviceUnavailable, match="hold BOOTSEL"):
        find_drive(roots=[tmp_path])


def test_two_boards_must_be_told_apart(tmp_path: Path, drive: Path) -> None:
    second = mounted(drive.parent / "RPI-RP21")
    with pytest.raises(DeviceUnavailable, match="several are mounted"):
        find_drive(roots=[tmp_path / "media"])
    assert find_drive(second) == second


@pytest.mark.parametrize("board", ["RP2350", "nRF52840-Feather-revD"])
def test_another_board_is_refused(tmp_path: Path, board: str) -> None:
    with pytest.raises(DeviceUnavailable, match=f"board {board}, not to an RPI-RP2"):
        find_drive(mounted(tmp_path / "other", board))


def test_a_folder_that_is_no_board_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DeviceUnavailable, match="is no UF2 drive"):
        find_drive(tmp_path)


def test_the_image_arrives_unchanged(tmp_path: Path, drive: Path) -> None:
    image = load_image(saved(tmp_path, uf2(bootable())))
    assert write_image(image, drive).read_bytes() == image.path.read_bytes()


def lose_drive(monkeypatch: pytest.MonkeyPatch, drive: Path, *, restarted: bool) -> None:
    def fail(_: int) -> None:
        if restarted:
            (drive / "INFO_UF2.TXT").unlink()
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr("server.rig.firmware_image.os.fsync", fail)


def test_a_board_that_restarts_with_its_last_block_has_got_it(
    tmp_path: Path, drive: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    image = load_image(saved(tmp_path, uf2(bootable())))
    lose_drive(monkeypatch, drive, restarted=True)
    assert write_image(image, drive).name == "pulse.uf2"


def test_a_board_that_stays_has_not_taken_the_image(
    tmp_path: Path, drive: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    image = load_image(saved(tmp_path, uf2(bootable())))
    lose_drive(monkeypatch, drive, restarted=False)
    with pytest.raises(DeviceError, match=r"1536 of 1536 bytes written: .* Input/output error"):
        write_image(image, drive)


def test_a_drive_that_refuses_is_an_error(tmp_path: Path, drive: Path) -> None:
    image = load_image(saved(tmp_path, uf2(bootable())))
    (drive / "pulse.uf2").mkdir()
    with pytest.raises(DeviceError, match=r"pulse\.uf2: 0 of 1536 bytes written"):
        write_image(image, drive)
