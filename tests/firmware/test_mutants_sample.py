"""The core's tests find planted faults: a few of ``firmware/tests/mutants.toml`` here, all by ``make mutants``."""

import re
import shutil
from pathlib import Path

import pytest

from firmware.tests.mutants import FIRMWARE, Mutant, MutantError, killer_of, load_mutants, verdict_of

MUTANTS = {mutant.name: mutant for mutant in load_mutants()}
SAMPLE = (
    "no rate limit",
    "lights are not forced low",
)


def test_there_are_many_different_ones() -> None:
    assert len(MUTANTS) == len(load_mutants()) >= 50


@pytest.mark.parametrize("mutant", MUTANTS.values(), ids=MUTANTS.keys())
def test_each_can_be_planted(mutant: Mutant, tmp_path: Path) -> None:
    file = mutant.file if "/" in mutant.file else f"core/{mutant.file}"
    (tmp_path / file).parent.mkdir(parents=True)
    shutil.copy(FIRMWARE / file, tmp_path / file)
    mutant.apply(tmp_path)
    assert (tmp_path / file).read_text() != (FIRMWARE / file).read_text()


@pytest.mark.parametrize("mutant", [m for m in MUTANTS.values() if m.tests], ids=lambda mutant: mutant.name)
def test_the_test_of_each_fault_of_the_port_exists(mutant: Mutant) -> None:
    file, _, rest = mutant.tests.partition("::")
    assert f"\ndef {rest.partition('[')[0]}(" in (Path(__file__).parent / file).read_text()


@pytest.mark.parametrize("name", SAMPLE)
def test_a_sample_is_found(name: str) -> None:
    assert killer_of(MUTANTS[name], sanitizers="") is not None


@pytest.mark.parametrize("name", ["a start forgets the stored limits", "damaged limits are taken for none"])
def test_the_fuzzer_alone_finds_a_core_that_loosens_stored_limits(name: str) -> None:
    killer = killer_of(MUTANTS[name], sanitizers="", only="fuzz")
    assert killer is not None
    assert killer.startswith("fuzz.c:")


def test_a_fault_that_does_no_harm_would_survive() -> None:
    harmless = Mutant("harmless", "limits.h", "CAMERA_PULSE_NS = 10000,", "CAMERA_PULSE_NS = 10000 + 0,")
    assert killer_of(harmless, sanitizers="") is None


def test_a_list_that_no_longer_fits_is_told(tmp_path: Path) -> None:
    (tmp_path / "core").mkdir()
    (tmp_path / "core" / "shooting.c").write_text("")
    with pytest.raises(MutantError, match=r"no rate limit: .* stands 0 times"):
        MUTANTS["no rate limit"].apply(tmp_path)


def test_one_that_does_not_compile_is_not_said_to_survive() -> None:
    nonsense = Mutant("nonsense", "limits.h", "CAMERA_PULSE_NS = 10000,", "CAMERA_PULSE_NS = ten,")
    verdict = verdict_of(nonsense)
    assert verdict.killer is None
    assert re.match(r"NOT PLANTED: \w+ does not compile: .*\bten\b", verdict.said, re.DOTALL)
