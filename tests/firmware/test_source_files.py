"""No file of the firmware needs itself by way of others, and functions carry the name of their file."""

import re
import subprocess
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

FIRMWARE = Path(__file__).resolve().parents[2] / "firmware"
COMPILERS = {"host": ("cc",), "rp2040": ("arm-none-eabi-gcc", "-mcpu=cortex-m0plus", "-mthumb")}
IMPLEMENTED = {
    "bench": "port",
    "serial_uart": "serial",
    "serial_usb": "serial",
    "set_points_dac": "set_points",
    "set_points_pwm": "set_points",
}
"""Sources that do what a header of another name says."""
GIVEN = {"main", "memcpy", "memset", "__aeabi_uidiv", "__aeabi_uidivmod"}
"""Names that the compiler asks for."""
Graph = dict[str, set[str]]


def part(file: Path) -> str:
    """A source and its header are one."""
    return str(file.relative_to(FIRMWARE).with_suffix(""))


class Build:
    """The core and the machine that it runs on."""

    def __init__(self, machine: str, folder: Path) -> None:
        self.files = [file for name in ("core", machine) for file in sorted((FIRMWARE / name).rglob("*.[chS]"))]
        folders = {f"-I{file.parent}" for file in self.files}
        flags = ["-std=c11", "-ffreestanding", "-D_GNU_SOURCE", '-DREVISION=""', '-DBUILD_NAME=""', *sorted(folders)]
        self.symbols = {}
        for source in self.files:
            if source.suffix != ".h":
                compiled = folder / f"{source.name}.o"
                subprocess.run([*COMPILERS[machine], *flags, "-c", source, "-o", compiled], check=True, timeout=60)
                self.symbols[part(source)] = symbols(compiled)

    def includes(self) -> Iterator[tuple[str, str]]:
        """(who, whom)."""
        parts = {file.name: part(file) for file in self.files}
        for file in self.files:
            for name in re.findall(r'^#include "([^"]+)"', file.read_text(), re.MULTILINE):
                yield part(file), parts[name]

    def calls(self) -> Iterator[tuple[str, str]]:
        """(who, whom), and whose variables are read."""
        for user, (_, needed) in self.symbols.items():
            for giver, (defined, _) in self.symbols.items():
                if needed & defined:
                    yield user, giver

    def graph(self) -> Graph:
        graph: Graph = {}
        for user, giver in (*self.includes(), *self.calls()):
            if user != giver:
                graph.setdefault(user, set()).add(giver)
        return graph


def symbols(compiled: Path) -> tuple[set[str], set[str]]:
    """Those that it defines for others, and those that it needs from others."""
    listing = subprocess.run(["nm", "-g", compiled], check=True, capture_output=True, text=True).stdout
    kinds = re.findall(r"(\w) (\w+)$", listing, re.MULTILINE)
    return {name for kind, name in kinds if kind in "TDRBC"}, {name for kind, name in kinds if kind == "U"}


def circle(graph: Graph) -> list[str] | None:
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return list(error.args[1])
    return None


@pytest.fixture(scope="module", params=COMPILERS)
def build(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Build:
    return Build(request.param, tmp_path_factory.mktemp("objects"))


def test_there_is_no_circle_of_files(build: Build) -> None:
    assert circle(build.graph()) is None


def test_a_circle_would_be_found(build: Build) -> None:
    graph = build.graph()
    graph["core/port"].add("core/protocol")
    assert circle(graph) is not None


def test_functions_carry_the_name_of_their_file(build: Build) -> None:
    for source, (defined, _) in build.symbols.items():
        stem = Path(source).name
        words = tuple(f"{word}_" for word in (stem, IMPLEMENTED.get(stem, stem)))
        assert not {name for name in defined - GIVEN if name != stem and not name.startswith(words)}, source


def test_includes_and_calls_are_both_seen(build: Build) -> None:
    assert ("core/commands", "core/error") in set(build.includes())
    assert ("core/commands", "core/shooting") in set(build.calls())
