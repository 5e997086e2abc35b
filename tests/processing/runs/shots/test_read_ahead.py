"""What is read ahead comes in order, one at most, and an error where its item would have come."""

import threading
from collections.abc import Iterator

import pytest

from processing.runs.shots.read_ahead import read_ahead

DEADLINE_S = 10.0


def test_one_item_is_made_while_that_before_it_is_used_and_no_more() -> None:
    made = [threading.Event() for _ in range(4)]

    def items() -> Iterator[int]:
        for number, event in enumerate(made):
            event.set()
            yield number

    used = []
    for number in read_ahead(items()):
        if number + 1 < len(made):
            assert made[number + 1].wait(DEADLINE_S)
        assert not any(event.is_set() for event in made[number + 2 :])
        used.append(number)
    assert used == [0, 1, 2, 3]


def test_an_error_comes_after_the_items_before_it() -> None:
    def items() -> Iterator[str]:
        yield "whole"
        raise OSError("the disk is gone")

    coming = read_ahead(items())
    assert next(coming) == "whole"
    with pytest.raises(OSError, match="the disk is gone"):
        next(coming)
