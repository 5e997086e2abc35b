"""The core's own tests, compiled with address and undefined-behaviour sanitizers."""

import random
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FIRMWARE = ROOT / "firmware"
BUILD = ROOT / "build" / "firmware"
CORPUS = BUILD / "corpus"
FUZZ_S = 4


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


def test_the_fuzz_target_takes_its_corpus_and_any_bytes(tmp_path: Path) -> None:
    """The inputs that libFuzzer found worth keeping, the golden vectors, and noise."""
    inputs = [*CORPUS.iterdir(), FIRMWARE / "tests" / "golden_vectors.txt"]
    assert len(inputs) > 100
    for seed in range(8):
        inputs.append(tmp_path / f"noise{seed}")
        inputs[-1].write_bytes(random.Random(seed).randbytes(20_000))
    finished = run("replay", *(str(path) for path in inputs))
    assert finished.returncode == 0, finished.stderr
    assert finished.stdout == f"{len(inputs)} inputs\n"


def clang_can_fuzz() -> bool:
    """Debian's clang comes without libFuzzer, which is in another package."""
    if shutil.which("clang") is None:
        return False
    source = "#include <stddef.h>\nint LLVMFuzzerTestOneInput(const void *d, size_t n) { return d && n ? 0 : 0; }"
    compiled = subprocess.run(
        ["clang", "-fsanitize=fuzzer", "-x", "c", "-", "-o", "/dev/null"], input=source, capture_output=True, text=True
    )
    return compiled.returncode == 0


@pytest.mark.skipif(not clang_can_fuzz(), reason="clang and libclang-rt-dev are not installed (make fuzz)")
def test_libfuzzer_finds_nothing_in_some_seconds(tmp_path: Path) -> None:
    subprocess.run(["make", "-C", str(FIRMWARE), "../build/firmware/libfuzzer"], check=True, capture_output=True)
    found = tmp_path / "new"
    found.mkdir()
    finished = run(
        "libfuzzer",
        f"-max_total_time={FUZZ_S}",
        "-max_len=2048",
        f"-artifact_prefix={tmp_path}/",
        str(found),
        str(CORPUS),
    )
    assert finished.returncode == 0, finished.stderr[-3000:]


def test_core_answers_the_golden_vectors() -> None:
    vectors = (FIRMWARE / "tests" / "golden_vectors.txt").read_text()
    finished = run("run_vectors", stdin=vectors)
    assert finished.returncode == 0, finished.stderr
    assert int(finished.stdout) == sum(line.startswith("<") for line in vectors.splitlines())


def test_a_changed_reply_fails_the_golden_vectors() -> None:
    vectors = (FIRMWARE / "tests" / "golden_vectors.txt").read_text()
    finished = run("run_vectors", stdin=vectors.replace("shots_left=2*", "shots_left=3*"))
    assert finished.returncode == 1
    assert "expected <6 1 OK train=1 shots_left=3" in finished.stderr


def test_core_links_without_a_c_library(tmp_path: Path) -> None:
    """A microcontroller has neither heap nor stdio nor floats; only the compiler itself may copy and clear."""
    linked = tmp_path / "core.o"
    sources = sorted((FIRMWARE / "core").glob("*.c"))
    flags = ["-std=c11", "-O2", "-ffreestanding", "-mgeneral-regs-only", "-r", "-nostdlib"]
    subprocess.run(["cc", *flags, *sources, "-o", linked], check=True)
    symbols = subprocess.run(["nm", "--undefined-only", linked], check=True, capture_output=True, text=True).stdout
    missing = {line.split()[-1] for line in symbols.splitlines()}
    assert {name for name in missing if not name.startswith("port_")} <= {"memcpy", "memset", "_GLOBAL_OFFSET_TABLE_"}
