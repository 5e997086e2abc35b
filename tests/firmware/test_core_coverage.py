"""How much of the core its own tests reach, line by line and branch by branch, as gcov counts."""

import json
import shutil
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

FIRMWARE = Path(__file__).resolve().parents[2] / "firmware"
TESTS = FIRMWARE / "tests"
LOWEST = 0.98
FUZZ = ("1", "100000")


@dataclass(frozen=True)
class Coverage:
    """Counts of one file: reached, all."""

    lines: tuple[int, int]
    branches: tuple[int, int]


def cc(*arguments: str | Path) -> None:
    flags = ["-std=c11", "-O0", "--coverage", "-DNDEBUG", f"-I{FIRMWARE / 'core'}", f"-I{TESTS}"]
    subprocess.run(["cc", *flags, *arguments], check=True, capture_output=True, timeout=60)


def run(program: Path, *arguments: str, stdin: str = "") -> None:
    subprocess.run([program, *arguments], input=stdin, check=True, capture_output=True, text=True, timeout=60)


@pytest.fixture(scope="module")
def coverage(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Coverage]:
    """The objects of the core are shared by all programs, so that their counts add up."""
    folder = tmp_path_factory.mktemp("coverage")
    objects = []
    for source in sorted((FIRMWARE / "core").glob("*.c")):
        objects.append(folder / f"{source.stem}.o")
        cc("-c", source, "-o", objects[-1])
    vectors = (TESTS / "golden_vectors.txt").read_text()
    programs: list[tuple[Path, tuple[str, ...], str]] = [(source, (), "") for source in sorted(TESTS.glob("test_*.c"))]
    programs += [(TESTS / "run_vectors.c", (), vectors), (TESTS / "fuzz.c", FUZZ, "")]
    for source, arguments, stdin in programs:
        program = folder / source.stem
        cc(source, TESTS / "fake_port.c", *objects, "-o", program)
        run(program, *arguments, stdin=stdin)
    return dict(_counted(folder, objects))


def _counted(folder: Path, objects: list[Path]) -> Iterator[tuple[str, Coverage]]:
    for compiled in objects:
        command: list[str | Path] = ["gcov", "--json-format", "--stdout", "--branch-probabilities", compiled]
        said = subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True, timeout=60).stdout
        lines: list[dict[str, Any]] = [
            line
            for file in json.loads(said)["files"]
            if Path(file["file"]).stem == compiled.stem
            for line in file["lines"]
        ]
        branches = [branch["count"] for line in lines for branch in line["branches"]]
        yield compiled.stem, Coverage(_reached([line["count"] for line in lines]), _reached(branches))


def _reached(counts: list[int]) -> tuple[int, int]:
    return sum(count > 0 for count in counts), len(counts)


@pytest.mark.skipif(shutil.which("gcov") is None, reason="gcov comes with gcc")
def test_the_tests_reach_nearly_every_line_and_branch_of_the_core(coverage: dict[str, Coverage]) -> None:
    assert set(coverage) == {source.stem for source in (FIRMWARE / "core").glob("*.c")}
    for kind in ("branches", "lines"):
        counts = {name: getattr(file, kind) for name, file in coverage.items()}
        reached, total = (sum(count[i] for count in counts.values()) for i in range(2))
        assert reached / total >= LOWEST, f"{reached} of {total} {kind}: {counts}"
