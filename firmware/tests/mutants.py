# ruff: noqa: T201
"""Plants faults in a copy of the core, one at a time, and shows that its tests find each.

    mutants.py [NAME ...]      all of mutants.toml, or those whose name contains one of the words

Prints a table; exit status 1 if a fault survives.
"""

import os
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

FIRMWARE = Path(__file__).resolve().parents[1]
FUZZ_STEPS = "100000"
LIMIT_S = 60
_WIDTH = 100


class MutantError(Exception):
    """The list does not fit the core any more; names the mutant."""


@dataclass(frozen=True)
class Mutant:
    """A planted fault: in this file of the core, this text instead of that."""

    name: str
    file: str
    old: str
    new: str

    def apply(self, core: Path) -> None:
        """Plant the fault in a copy of the core."""
        path = core / self.file
        text = path.read_text()
        if text.count(self.old) != 1:
            raise MutantError(f"{self.name}: the text to replace stands {text.count(self.old)} times in {self.file}")
        path.write_text(text.replace(self.old, self.new))


def load_mutants() -> list[Mutant]:
    """All planted faults."""
    table = tomllib.loads(Path(__file__).with_suffix(".toml").read_text())
    return [Mutant(**entry) for entry in table["mutant"]]


def killer_of(mutant: Mutant | None, sanitizers: str | None = None) -> str | None:
    """First check that fails on a core with this fault, or on the healthy one; None if none does.

    Parameters
    ----------
    mutant : Mutant or None
        The fault; None for the healthy core.
    sanitizers : str or None
        Options of the compiler in the place of the Makefile's; an empty text compiles three times as fast.

    Raises
    ------
    MutantError
        The fault cannot be planted, or does not compile.
    """
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder, "firmware")
        shutil.copytree(FIRMWARE, copy)
        if mutant is not None:
            mutant.apply(copy / "core")
        tests = copy / "tests"
        vectors = (tests / "golden_vectors.txt").read_text()
        programs = [(source.stem, (), "") for source in sorted(tests.glob("test_*.c"))]
        for program, arguments, stdin in [*programs, ("run_vectors", (), vectors), ("fuzz", ("1", FUZZ_STEPS), "")]:
            built = _build(copy, program, sanitizers)
            if failure := _failure(built, arguments, stdin):
                return failure
    return None


def _build(firmware: Path, program: str, sanitizers: str | None) -> Path:
    """One program at a time: most faults are found by the first or the second."""
    build = firmware.parent / "build"
    options = [] if sanitizers is None else [f"SANITIZE={sanitizers}"]
    made = _run("make", "-C", str(firmware), f"{build}/{program}", f"BUILD={build}", "CFLAGS=-O0", *options)
    if made.returncode:
        raise MutantError(f"{program} does not compile: {made.stderr.strip()}")
    return build / program


def _failure(program: Path, arguments: Sequence[str], stdin: str) -> str | None:
    try:
        finished = _run(str(program), *arguments, stdin=stdin)
    except subprocess.TimeoutExpired:
        return f"{program.name}: does not end"
    if finished.returncode == 0:
        return None
    said = next((line for line in finished.stderr.splitlines() if line.strip(" =")), f"status {finished.returncode}")
    return said.strip().removeprefix("tests/")[:_WIDTH]


def _run(*command: str, stdin: str = "") -> subprocess.CompletedProcess[str]:
    environment = {name: value for name, value in os.environ.items() if name != "MAKEFLAGS"}
    return subprocess.run(
        command, input=stdin, capture_output=True, text=True, timeout=LIMIT_S, check=False, env=environment
    )


def main(words: Sequence[str]) -> int:
    """Kill the chosen mutants; the exit status."""
    if healthy := killer_of(None):
        print(f"the healthy core fails already: {healthy}", file=sys.stderr)
        return 1
    mutants = [mutant for mutant in load_mutants() if not words or any(word in mutant.name for word in words)]
    survivors = 0
    with ThreadPoolExecutor(os.cpu_count()) as workers:
        for mutant, killer in zip(mutants, workers.map(killer_of, mutants), strict=True):
            survivors += killer is None
            print(f"{mutant.name:52}{killer or 'SURVIVED'}", flush=True)
    print(f"{len(mutants) - survivors} of {len(mutants)} planted faults found")
    return 1 if survivors or not mutants else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
