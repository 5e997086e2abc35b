"""What is kept from shot to shot: the latest, and no more of it."""

from functools import partial

import pytest

from processing.runs.workbench import Latest


@pytest.mark.parametrize("most", [1, 2, 3])
def test_the_latest_are_kept_and_no_more(most: int) -> None:
    made: list[int] = []
    latest: Latest[int] = Latest(most)

    def make(key: int) -> int:
        made.append(key)
        return key

    for key in (0, 1, 2, 3, 3, 2, 1, 0):
        assert latest.of(key, partial(make, key)) == key
    missed = [key for key in (2, 1, 0) if 3 - key >= most]
    assert made == [0, 1, 2, 3, *missed]


def test_what_was_asked_for_again_stays_longer() -> None:
    latest: Latest[object] = Latest(2)
    first = latest.of("first", object)
    latest.of("second", object)
    assert latest.of("first", object) is first
    latest.of("third", object)
    assert latest.of("first", object) is first
