"""The kernels without Python: under sanitizers, and on arm64."""

import os
import shutil
import subprocess
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from processing.kernels import _native

KERNELS = Path(__file__).parents[3] / "processing" / "kernels"
DRIVER = Path(__file__).with_name("kernel_driver") / "driver.cpp"
SOURCES = sorted(map(str, (KERNELS / "host").glob("*.cpp")))
ARCHITECTURE = {"plain": [], "avx2": ["-march=x86-64-v3"], "avx512": ["-march=x86-64-v4"]}
SANITIZERS = ["-O0", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
MEMORY = ["-O0", "-fsanitize=address"]
"""For vectors: what is undefined but a step beyond memory is in what all share, and in the numbers of ``plain``."""
DEADLINE_S = 200.0
CASES = {
    "sight": 21,
    "smart": 14,
    "resample": 30,
    "prepare": 30,
    "blobs": 10,
    "stamps": 20,
    "discs": 10,
    "runs": 20,
    "maxima": 20,
}
Results = dict[tuple[str, int], tuple[float, float]]


def compile_kernels(compiler: str, options: list[str], isa: str, directory: Path) -> Path:
    out = directory / f"{isa}.o"
    run([compiler, "-std=c++17", *options, f"-DTOMOSHADOW_ISA={isa}", "-I.", "-c", "simd/kernels.cpp", "-o", str(out)])
    return out


def link(compiler: str, options: list[str], objects: list[Path], program: Path) -> None:
    sources = [str(DRIVER), *SOURCES, *map(str, objects)]
    run([compiler, "-std=c++17", *options, "-I.", *sources, "-o", str(program), "-pthread"])


def run(command: list[str], **environment: str) -> str:
    process = subprocess.run(
        command, cwd=KERNELS, env=os.environ | environment, capture_output=True, text=True, timeout=DEADLINE_S
    )
    assert process.returncode == 0, process.stderr
    return process.stdout


def results(output: str) -> Results:
    """Two sums of what each case computed, by kind and number of the case."""
    cases = map(str.split, output.splitlines())
    return {(kind, int(number)): (float(first), float(second)) for kind, number, first, second in cases}


def assert_agree(some: Results, others: Results) -> None:
    """Samples differ by up to 1e-4 of the brightest pixel, sums of many by much less."""
    assert Counter(kind for kind, _ in some) == CASES
    assert some.keys() == others.keys()
    for kind, cases in CASES.items():
        assert sum(some[kind, number][0] > 0 for number in range(cases)) > cases // 2
    for case, sums in some.items():
        share = 1e-3 if case[0] == "smart" else 1e-4  # of SMART: for its ratios, whose steps are 5e-4
        rest = 2 / 32767 if case[0] == "resample" else 1e-5  # of resampling: two counts, for sums of few pixels
        assert sums == pytest.approx(others[case], rel=share, abs=rest), case


@pytest.fixture(scope="module")
def sanitized(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The driver under sanitizers, but for instruction sets that are linked and that this processor does not run."""
    directory = tmp_path_factory.mktemp("sanitized")
    runs = set(_native.available_isas())
    linked = runs | ({"avx2", "avx512"} if "avx2" in runs else set())

    def compiled(isa: str) -> Path:
        options = SANITIZERS if isa == "plain" else MEMORY if isa in runs else ["-O0"]
        return compile_kernels("g++", options + ARCHITECTURE[isa], isa, directory)

    with ThreadPoolExecutor(2) as pool:
        objects = pool.map(compiled, sorted(linked))
        link("g++", SANITIZERS, list(objects), directory / "driver")
    return directory / "driver"


@pytest.fixture(scope="module")
def plain(sanitized: Path) -> Results:
    return results(run([str(sanitized)], TOMOSHADOW_ISA="plain"))


def test_sanitizers_find_nothing_on_any_instruction_set(sanitized: Path, plain: Results) -> None:
    for isa in _native.available_isas():
        assert_agree(plain, plain if isa == "plain" else results(run([str(sanitized)], TOMOSHADOW_ISA=isa)))


def test_arm64_computes_the_same(plain: Results, tmp_path: Path) -> None:
    compiler = "aarch64-linux-gnu-g++"
    missing = [name for name in (compiler, "qemu-aarch64") if shutil.which(name) is None]
    if missing:
        pytest.skip(f"{' and '.join(missing)} missing: make test installs them")
    options = ["-O0", "-static", "-Wall", "-Wextra", "-Werror"]
    link(compiler, options, [compile_kernels(compiler, options, "plain", tmp_path)], tmp_path / "driver")
    assert_agree(plain, results(run(["qemu-aarch64", str(tmp_path / "driver")])))
