"""SimulatedChip: a GPIO chip for the real libgpiod, compiled at first use where there is a C compiler."""

import ctypes
import functools
import shutil
import subprocess
import tempfile
from pathlib import Path

from daq.drivers.gpio_interlock import library_path

CHIP_PATH = "/dev/gpiochip-simulated"
BROKEN_WIRE = -1

_SOURCE = Path(__file__).with_name("gpio_chip.c")
_COMPILE = ("-std=gnu11", "-shared", "-fPIC", "-O2", "-Wall", "-Wextra", "-Wconversion", "-Werror")


class ChipUnsupported(Exception):
    """The machine cannot have a simulated chip: no C compiler, or a libgpiod that cannot be redirected."""


@functools.cache
def _load() -> ctypes.CDLL:
    compiler = shutil.which("cc")
    if compiler is None:
        raise ChipUnsupported("no C compiler (cc) is installed")
    with tempfile.TemporaryDirectory() as folder:
        library = f"{folder}/gpio_chip.so"
        built = subprocess.run([compiler, *_COMPILE, "-o", library, _SOURCE], capture_output=True, text=True)
        if built.returncode:
            raise ChipUnsupported(f"{_SOURCE.name} does not compile: {built.stderr.strip()}")
        chip = ctypes.CDLL(library)
    if not chip.gpio_chip_redirect(library_path().encode()):
        raise ChipUnsupported(f"{library_path()} has no call that can be redirected")
    return chip


def free_line() -> int:
    """Lowest line of the chip that nobody reads.

    Raises
    ------
    ChipUnsupported
        The machine cannot have a simulated chip, or all its lines are taken.
    """
    line = int(_load().gpio_chip_free_line())
    if line < 0:
        raise ChipUnsupported(f"all lines of {CHIP_PATH} are taken")
    return line


class SimulatedSwitchLine:
    """The laboratory's side of an interlock: a door switch wired to one line of the simulated chip.

    Parameters
    ----------
    line : int
        Offset of the line, 0 to 7.
    active_low : bool
        The closed chain connects the line to ground.

    Raises
    ------
    ChipUnsupported
        This machine cannot have a simulated chip.
    """

    def __init__(self, line: int, *, active_low: bool = False) -> None:
        self._chip, self._line, self._active_low = _load(), line, active_low
        self.break_wire()

    def close_door(self) -> None:
        """Let the chain conduct."""
        self._drive(0 if self._active_low else 1)

    def open_door(self) -> None:
        """Interrupt the chain: the wire is left to the bias of the input."""
        self._drive(BROKEN_WIRE)

    def break_wire(self) -> None:
        """Cut the cable; the input cannot tell it from an open door, and that is the point."""
        self._drive(BROKEN_WIRE)

    def _drive(self, wire: int) -> None:
        if self._chip.gpio_chip_drive(self._line, wire):
            raise ValueError(f"line: {self._line} is outside 0 to 7 of {CHIP_PATH}")
