"""The core's own tests, compiled with address and undefined-behaviour sanitizers."""

import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FIRMWARE = ROOT / "firmware"
BUILD = ROOT / "build" / "firmware"


@pytest.fixture(scope="module", autouse=True)
def _built() -> None:
    subprocess.run(["make", "-C", str(FIRMWARE), "tests"], check=True, capture_output=True, timeout=100)


def run(program: str, *arguments: str, stdin: str = "") -> subprocess.CompletedProcess[str]:
    return subprocess.run([BUILD / program, *arguments], input=stdin, capture_output=True, text=True, timeout=60)


@pytest.mark.parametrize("program", [path.stem for path in sorted((FIRMWARE / "tests").glob("test_*.c"))])
def test_unit_tests_pass(program: str) -> None:
    finished = run(program)
    assert finished.returncode == 0, finished.stderr


@pytest.mark.parametrize("seed", ["1", "2", "3"])
def test_hostile_input_never_breaks_an_invariant(seed: str) -> None:
    finished = run("fuzz", seed, "400000")
    assert finished.returncode == 0, finished.stderr + finished.stdout


def test_core_answers_the_golden_vectors() -> None:
    vectors = (FIRMWARE / "tests" / "golden_vectors.txt").read_text()
    finished = run("run_vectors", stdin=vectors)
    assert finished.returncode == 0, finished.stderr
    assert int(finished.stdout) == sum(line.startswith("<") for line in vectors.splitlines())


def test_a_changed_reply_fails_the_golden_vectors() -> None:
    vectors = (FIRMWARE / "tests" / "golden_vectors.txt").read_text()
    finished = run("run_vectors", stdin=vectors.replace("shots_left=2*", "shots_left=3*"))
    assert finished.returncode == 1
    assert "expected 6 1 OK train=1 shots_left=3" in finished.stderr


def test_core_links_without_a_c_library(tmp_path: Path) -> None:
    """A microcontroller has neither heap nor stdio nor floats; only the compiler itself may copy and clear."""
    linked = tmp_path / "core.o"
    sources = sorted((FIRMWARE / "core").glob("*.c"))
    flags = ["-std=c11", "-O2", "-ffreestanding", "-mgeneral-regs-only", "-r", "-nostdlib"]
    subprocess.run(["cc", *flags, *sources, "-o", linked], check=True)
    symbols = subprocess.run(["nm", "--undefined-only", linked], check=True, capture_output=True, text=True).stdout
    missing = {line.split()[-1] for line in symbols.splitlines()}
    assert {name for name in missing if not name.startswith("port_")} <= {"memcpy", "memset", "_GLOBAL_OFFSET_TABLE_"}
