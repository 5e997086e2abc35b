"""The image of the Raspberry Pi Pico as a file: what the boot ROM and its drive expect, and the budget."""

import re
import struct
from pathlib import Path

import pytest

from daq.simulation.pico import rp2040_chip
from daq.simulation.pico.firmware_build import build_image
from daq.simulation.pico.rp2040_emulator import EmulatedPico

ROOT = Path(__file__).resolve().parents[2]
FIRMWARE = ROOT / "firmware" / "rp2040"


@pytest.fixture(scope="module")
def image() -> Path:
    return build_image()


def mpeg2_crc(data: bytes) -> int:
    """CRC-32/MPEG-2 as a division of polynomials."""
    dividend = int.from_bytes(data, "big") << 32 ^ 0xFFFF_FFFF << 8 * len(data)
    for bit in range(8 * len(data) + 31, 31, -1):
        if dividend >> bit & 1:
            dividend ^= 0x1_04C1_1DB7 << bit - 32
    return dividend


def test_the_second_boot_stage_carries_its_crc(image: Path) -> None:
    boot2 = image.read_bytes()[:256]
    assert mpeg2_crc(b"123456789") == 0x0376_E6E7
    assert struct.unpack("<I", boot2[252:]) == (mpeg2_crc(boot2[:252]),)


def test_the_boot_rom_refuses_a_damaged_boot_stage(image: Path) -> None:
    damaged = bytearray(image.read_bytes())
    damaged[10] ^= 1
    board = EmulatedPico(bytes(damaged))
    board.run_ms(20)
    assert board.read_word(0xE000_ED08) == 0, "the vector table still is that of the boot ROM"


def test_the_uf2_file_is_the_image_page_by_page(image: Path) -> None:
    uf2, content = image.with_suffix(".uf2").read_bytes(), image.read_bytes()
    blocks = [uf2[start : start + 512] for start in range(0, len(uf2), 512)]
    written = b""
    for number, block in enumerate(blocks):
        header = struct.unpack("<8I", block[:32])
        address = 0x1000_0000 + len(written)
        assert header == (0x0A32_4655, 0x9E5D_5157, 0x2000, address, 256, number, len(blocks), 0xE48B_FF56)
        assert struct.unpack("<I", block[508:]) == (0x0AB1_6F30,)
        written += block[32 : 32 + 256]
    assert written[: len(content)] == content
    assert not any(written[len(content) :])
    assert len(written) - len(content) < 256


def test_simulation_and_firmware_agree_on_the_pins() -> None:
    in_c = dict(re.findall(r"(PIN_\w+) = (\d+)", (FIRMWARE / "pins.h").read_text()))
    names = ("PIN_LIGHT", "PIN_CAMERA", "PIN_TRIGGER", "PIN_INTERLOCK", "PIN_ESTOP", "PIN_SET_POINT")
    assert {name: int(in_c[name]) for name in names} == {name: getattr(rp2040_chip, name) for name in names}


def test_the_wiring_guide_has_the_pins_of_the_firmware() -> None:
    in_c = re.findall(r"(PIN_\w+) = (\d+)", (FIRMWARE / "pins.h").read_text())
    guide = (ROOT / "docs" / "firmware" / "wiring.md").read_text()
    assert re.findall(r"^\| (PIN_\w+) \| (\d+)", guide, re.MULTILINE) == in_c
