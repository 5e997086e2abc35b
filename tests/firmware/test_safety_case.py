"""Every test and every planted fault that the safety case names exists."""

import re
from pathlib import Path

import pytest

from firmware.tests.mutants import load_mutants

ROOT = Path(__file__).resolve().parents[2]
CASE = (ROOT / "docs" / "firmware" / "safety.md").read_text()
ROWS = [line.strip("| ").split(" | ") for line in CASE.splitlines() if line.startswith("| ")][1:]


def existing_tests() -> set[str]:
    sources = [*(ROOT / "firmware" / "tests").glob("test_*.c"), *(ROOT / "tests").rglob("test_*.py")]
    definition = re.compile(r"^(?:static void|def) (test_\w+)\(", re.MULTILINE)
    return {name for source in sources for name in definition.findall(source.read_text())}


EXISTING = existing_tests()
PLANTED = {mutant.name for mutant in load_mutants()}


@pytest.mark.parametrize("row", ROWS, ids=[row[0] for row in ROWS])
def test_a_hazard_has_a_defence_and_tests_that_exist(row: list[str]) -> None:
    hazard, defence, evidence = row
    assert hazard
    assert defence
    named = set(re.findall(r"`(test_\w+)`", evidence))
    assert named, "a defence without a test is a hope"
    assert named <= EXISTING, named - EXISTING
    planted = set(re.findall(r'"([^"]+)"', evidence))
    assert planted <= PLANTED, planted - PLANTED


def test_the_case_is_complete_enough_to_be_read_as_one() -> None:
    assert len(ROWS) >= 28
    assert all(len(row) == 3 for row in ROWS)


def test_nothing_else_in_the_case_looks_like_a_test() -> None:
    assert set(re.findall(r"\btest_\w+", CASE)) <= EXISTING
