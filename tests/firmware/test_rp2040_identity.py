"""What the real image says of itself: board, revision, and why it has started."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from daq.drivers.pulse_protocol import Command
from daq.simulation.pico.board_number import BOARD_NUMBER
from daq.simulation.pico.firmware_build import ImageKind, build_image
from tests.support.rp2040_board import BOOT_MS, Board

FIRMWARE = Path(__file__).resolve().parents[2] / "firmware"
KIB = 1024
WATCHDOG_MS = 200
POWER, RUN_PIN, WATCHDOG, SOFTWARE = 1, 2, 4, 5
SCRATCH_0, FORCED_RESET = 0x4005_800C, (0x4005_8000, 1 << 31)


def cause(board: Board) -> int:
    return board.ask(Command.ID).number("cause")


def test_it_has_the_number_of_its_flash() -> None:
    assert Board().ask(Command.ID).fields["serial"] == BOARD_NUMBER.hex().upper()


def test_a_flash_without_a_number_makes_an_unknown_board(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("daq.simulation.pico.rp2040_emulator.give_number", lambda chip: None)
    assert Board().ask(Command.ID).fields["serial"] == "unknown"


def test_every_image_says_which_one_it_is() -> None:
    builds = {kind: Board(kind).ask(Command.ID).fields["build"] for kind in (ImageKind.CONVERTER, ImageKind.PWM)}
    assert builds == {ImageKind.CONVERTER: "rp2040", ImageKind.PWM: "rp2040-pwm"}
    assert b"build=" in build_image(kind=ImageKind.USB).read_bytes()
    assert b"rp2040-usb" in build_image(kind=ImageKind.USB).read_bytes()


def test_it_knows_why_it_has_started() -> None:
    board = Board()
    first = board.ask(Command.ID)
    assert first.number("cause") == POWER
    board.pico.press_run()
    board.pico.run_ms(BOOT_MS)
    assert cause(board) == RUN_PIN
    before = board.ask(Command.ID).boot
    assert before != first.boot
    board.pico.hang()
    board.pico.run_ms(WATCHDOG_MS + BOOT_MS)
    again = board.ask(Command.ID)
    assert (again.number("cause"), again.boot) == (WATCHDOG, before + 1)
    board.pico.write_word(SCRATCH_0, 0)
    board.pico.write_word(*FORCED_RESET)
    board.pico.run_ms(BOOT_MS)
    assert cause(board) == SOFTWARE, "as after the boot loader has written an image"


def revision(image: Path) -> str:
    return (image.parent / "revision").read_text().strip()


def test_the_revision_is_the_commit_that_changed_the_firmware_last() -> None:
    image = build_image()
    answered = Board().ask(Command.ID).fields["git"]
    assert re.fullmatch(r"[0-9a-f]{12}(-modified)?|unknown", answered)
    assert answered == revision(image)


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The sources in another place, outside version control."""
    return shutil.copytree(FIRMWARE, tmp_path_factory.mktemp("another") / "longer" / "place" / "firmware")


def make(firmware: Path, *words: str) -> subprocess.CompletedProcess[str]:
    command = ["make", "-s", "-C", str(firmware), f"BUILD={firmware.parent}", *words]
    return subprocess.run(command, check=False, capture_output=True, text=True)


def test_images_of_the_same_sources_are_the_same_bytes(copy: Path) -> None:
    """Two kinds consist of all sources."""
    images = {kind: build_image(kind=kind) for kind in (ImageKind.PWM, ImageKind.USB)}
    files = [str(copy.parent / f"{kind}.uf2") for kind in images]
    made = make(copy, *files, f"REVISION={revision(images[ImageKind.USB])}")
    assert made.returncode == 0, made.stderr
    for kind, image in images.items():
        assert (copy.parent / f"{kind}.uf2").read_bytes() == image.with_suffix(".uf2").read_bytes(), kind


def test_outside_version_control_the_revision_is_unknown(copy: Path) -> None:
    assert "REVISION='\"unknown\"'" in make(copy, "-n", "-W", "Makefile", "image").stdout


def test_an_image_that_might_overflow_its_stack_is_not_built(copy: Path) -> None:
    refused = make(copy, "image", f"BUILD={copy.parent / 'overflow'}", "STACK_SIZE=512")
    assert refused.returncode != 0
    assert re.search(r"\d+ bytes of stack do not fit 512", refused.stderr)
    assert not (copy.parent / "overflow" / f"{ImageKind.CONVERTER}.uf2").exists()


def sections(image: Path) -> dict[str, tuple[int, int]]:
    """(size, address) by name."""
    told = subprocess.run(
        ["arm-none-eabi-size", "-A", image.with_suffix(".elf")], check=True, capture_output=True, text=True
    ).stdout
    return {name: (int(size), int(at)) for name, size, at in re.findall(r"^(\.\S+)\s+(\d+)\s+(\d+)", told, re.M)}


@pytest.mark.parametrize("kind", ImageKind)
def test_every_image_keeps_its_budget(kind: ImageKind) -> None:
    image = build_image(kind=kind)
    assert image.stat().st_size < 24 * KIB
    parts = sections(image)
    in_ram = {name: size for name, (size, at) in parts.items() if at >= 0x2000_0000}
    assert sum(in_ram.values()) < 16 * KIB, in_ram
    symbols = subprocess.run(
        ["arm-none-eabi-nm", image.with_suffix(".elf")], check=True, capture_output=True, text=True
    ).stdout
    assert "outputs_off" in symbols
    assert not re.findall(r"malloc|__aeabi_[df](?!iv)\w+|__aeabi_[ui]2[fd]", symbols)
