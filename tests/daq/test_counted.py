"""No text says "1 shots"."""

import ast
import re
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest

from daq.counted import counted
from processing.count import counted as counted_in_processing

ROOT = Path(__file__).parents[2]
THINGS = (
    "alarms calibrations clusters diameters droplets exposures faults files frames images jobs ligaments lines objects "
    "pairs planes points positions runs shots sheets things tracks velocities views volumes workers"
)
NAMED = re.compile(rf" (?:{THINGS.replace(' ', '|')})\b")


def plurals(module: Path) -> Iterator[str]:
    """Parts of texts in which a whole number stands before things that are always many."""
    texts = [one for one in ast.walk(ast.parse(module.read_text("utf-8"))) if isinstance(one, ast.JoinedStr)]
    for number, words in (pair for text in texts for pair in pairwise(text.values)):
        found = NAMED.match(str(getattr(words, "value", "")))
        if found and isinstance(number, ast.FormattedValue) and not number.format_spec:
            yield f"{module.relative_to(ROOT)}:{number.lineno}: {{{ast.unparse(number.value)}}}{found[0]}"


def test_one_thing_is_not_many() -> None:
    for said in (counted, counted_in_processing):
        assert [said(number, "shot") for number in (0, 1, 2)] == ["0 shots", "1 shot", "2 shots"]


@pytest.mark.parametrize("room", sorted(path.name for path in (ROOT / "server").iterdir() if path.is_dir()))
def test_what_the_desk_the_server_and_commands_say_of_one_thing_is_not_said_of_many(room: str) -> None:
    modules = sorted((ROOT / "server" / room).rglob("*.py"))
    assert [one for module in modules for one in plurals(module)] == []


def test_nor_is_what_processing_says_of_the_shots_of_a_run() -> None:
    modules = [*(ROOT / "processing" / "runs").rglob("*.py"), ROOT / "processing" / "analysis" / "shot_doubts.py"]
    assert [one for module in sorted(modules) for one in plurals(module)] == []
