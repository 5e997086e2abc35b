# ruff: noqa: T201
"""Plants faults in a copy of the firmware, one at a time, and shows that the tests find each.

    mutants.py [NAME ...]      all of mutants*.toml, or those whose name contains one of the words

Faults of the core are found by its own tests; those of the port to the Pico by tests of the real image in an emulator,
run by pytest. Prints a table; exit status 1 if a fault survives, or cannot be planted.
"""

import os
import shutil
import signal
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

FIRMWARE = Path(__file__).resolve().parents[1]
IMAGES_VARIABLE = "TOMOSHADOW_IMAGES"
FUZZ_STEPS = "100000"
LIMIT_CPU_S = 400
"""Of a process that plants one fault or runs its test; a busy computer ends nothing sooner."""
STANDSTILL_S = 3600
_WIDTH = 100
_NO_SANITIZERS = ""


class MutantError(Exception):
    """The list does not fit the firmware any more; names the mutant."""


@dataclass(frozen=True)
class Mutant:
    """A planted fault: in this file, this text instead of that.

    Parameters
    ----------
    name : str
        What goes wrong.
    file : str
        File in ``core``; with a folder before it, in the firmware.
    old, new : str
        The text to replace, which stands once in the file, and what takes its place.
    tests : str
        Node of pytest, below ``tests/firmware``, that has to find a fault of the port; empty for one of the core.
    """

    name: str
    file: str
    old: str
    new: str
    tests: str = ""

    def apply(self, firmware: Path) -> None:
        """Plant the fault in a copy of the firmware."""
        path = firmware / (self.file if "/" in self.file else f"core/{self.file}")
        text = path.read_text()
        if text.count(self.old) != 1:
            raise MutantError(f"{self.name}: the text to replace stands {text.count(self.old)} times in {self.file}")
        path.write_text(text.replace(self.old, self.new))


def load_mutants() -> list[Mutant]:
    """All planted faults."""
    files = sorted(Path(__file__).parent.glob("mutants*.toml"))
    return [Mutant(**entry) for file in files for entry in tomllib.loads(file.read_text())["mutant"]]


def killer_of(mutant: Mutant | None, sanitizers: str | None = None, only: str = "") -> str | None:
    """First check that fails on a core with this fault, or on the healthy one; None if none does.

    Parameters
    ----------
    mutant : Mutant or None
        The fault; None for the healthy core.
    sanitizers : str or None
        Options of the compiler in the place of the Makefile's; an empty text compiles three times as fast.
    only : str
        The one program that is to find a fault of the core; empty for all.

    Raises
    ------
    MutantError
        The fault cannot be planted, or does not compile.
    """
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder, "firmware")
        shutil.copytree(FIRMWARE, copy)
        if mutant is not None:
            mutant.apply(copy)
            if mutant.tests:
                return _killer_of_images(copy, [mutant.tests])
        return _killer_of_core(copy, sanitizers, only)


def killer_of_healthy_images(mutants: Sequence[Mutant]) -> str | None:
    """The test, of those that find the faults of the port, which fails on a healthy image; None if none does."""
    nodes = sorted({mutant.tests for mutant in mutants if mutant.tests})
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder, "firmware")
        shutil.copytree(FIRMWARE, copy)
        return _killer_of_images(copy, nodes) if nodes else None


def _killer_of_core(firmware: Path, sanitizers: str | None, only: str) -> str | None:
    tests = firmware / "tests"
    vectors = (tests / "golden_vectors.txt").read_text()
    programs = [(source.stem, (), "") for source in sorted(tests.glob("test_*.c"))]
    for program, arguments, stdin in [*programs, ("run_vectors", (), vectors), ("fuzz", ("1", FUZZ_STEPS), "")]:
        if only not in ("", program):
            continue
        built = _build(firmware, program, sanitizers)
        if failure := _failure(built, arguments, stdin):
            return failure
    return None


def _killer_of_images(firmware: Path, nodes: Sequence[str]) -> str | None:
    """The compiler's static assertions are tests too."""
    build = firmware.parent / "build"
    images = sorted({f"{build}/tomoshadow-rp2040{'-usb' if 'usb' in node else ''}.uf2" for node in nodes})
    made = _run("make", "-C", str(firmware), *images, f"BUILD={build}")
    if made.returncode:
        asserted = next((line for line in made.stderr.splitlines() if "static assertion failed" in line), None)
        if asserted is None:
            raise MutantError(f"the image does not compile: {made.stderr.strip()}")
        return asserted.partition("error: ")[2][:_WIDTH]
    command = (
        sys.executable,
        "-m",
        "pytest",
        "-x",
        "-q",
        "-p",
        "no:cacheprovider",
        f"--rootdir={FIRMWARE.parent}",
        *(f"{FIRMWARE.parent}/tests/firmware/{node}" for node in nodes),
    )
    finished = _run(*command, images=str(build), limit_cpu_s=LIMIT_CPU_S * len(nodes))
    if _has_not_ended(finished):
        return f"{nodes[0]}: does not end"
    if finished.returncode not in (0, 1):  # neither passed nor failed
        raise MutantError(f"{' '.join(nodes)} cannot be run: {(finished.stderr + finished.stdout).strip()}")
    failed = (line for line in finished.stdout.splitlines() if line.startswith(("FAILED", "ERROR")))
    return next((line.partition("::")[2][:_WIDTH] for line in failed), None) if finished.returncode else None


def _build(firmware: Path, program: str, sanitizers: str | None) -> Path:
    """One program at a time: most faults are found by the first or the second."""
    build = firmware.parent / "build"
    options = [] if sanitizers is None else [f"SANITIZE={sanitizers}"]
    made = _run("make", "-C", str(firmware), f"{build}/{program}", f"BUILD={build}", "CFLAGS=-O0", *options)
    if made.returncode:
        raise MutantError(f"{program} does not compile: {made.stderr.strip()}")
    return build / program


def _failure(program: Path, arguments: Sequence[str], stdin: str) -> str | None:
    finished = _run(str(program), *arguments, stdin=stdin)
    if _has_not_ended(finished):
        return f"{program.name}: does not end"
    if finished.returncode == 0:
        return None
    said = next((line for line in finished.stderr.splitlines() if line.strip(" =")), f"status {finished.returncode}")
    return said.strip().removeprefix("tests/")[:_WIDTH]


def _has_not_ended(finished: subprocess.CompletedProcess[str]) -> bool:
    return finished.returncode == -signal.SIGXCPU


def _run(
    *command: str, stdin: str = "", images: str = "", limit_cpu_s: int = LIMIT_CPU_S
) -> subprocess.CompletedProcess[str]:
    """What stands still without taking a processor is no verdict: an exception."""
    environment = {name: value for name, value in os.environ.items() if name != "MAKEFLAGS"} | {IMAGES_VARIABLE: images}
    return subprocess.run(
        ("prlimit", f"--cpu={limit_cpu_s}:{limit_cpu_s + 5}", *command),
        cwd=FIRMWARE.parent,
        input=stdin,
        capture_output=True,
        text=True,
        timeout=STANDSTILL_S,
        check=False,
        env=environment,
    )


@dataclass(frozen=True)
class Verdict:
    """What became of a planted fault: the check that found it, and if none did, what is to be said."""

    killer: str | None
    said: str


def verdict_of(mutant: Mutant) -> Verdict:
    """Plant a fault and look for it; most need no sanitizer. One that does not compile proves nothing."""
    try:
        killer = killer_of(mutant, _NO_SANITIZERS) or (None if mutant.tests else killer_of(mutant))
    except MutantError as error:
        return Verdict(None, f"NOT PLANTED: {error}")
    return Verdict(killer, killer or "SURVIVED")


def main(words: Sequence[str]) -> int:
    """Kill the chosen mutants; the exit status."""
    mutants = [mutant for mutant in load_mutants() if not words or any(word in mutant.name for word in words)]
    found = 0
    with ThreadPoolExecutor(os.cpu_count()) as workers:
        healthy = [workers.submit(killer_of, None), workers.submit(killer_of_healthy_images, mutants)]
        if killer := next((each.result() for each in healthy if each.result()), None):
            print(f"the healthy firmware fails already: {killer}", file=sys.stderr)
            return 1
        for mutant, verdict in zip(mutants, workers.map(verdict_of, mutants), strict=True):
            found += verdict.killer is not None
            print(f"{mutant.name:52}{verdict.said}", flush=True)
    print(f"{found} of {len(mutants)} planted faults found")
    return 0 if mutants and found == len(mutants) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
