"""Items side by side: as many as there are lanes, in their order, and an error where its item would have come."""

import threading

import pytest

from processing.runs.shots.lanes import in_lanes

DEADLINE_S = 20.0


def test_items_are_worked_on_side_by_side_and_come_in_order() -> None:
    together, used = threading.Barrier(2, timeout=DEADLINE_S), list[str]()

    def work(lane: str, item: int) -> int:
        together.wait()  # nobody passes alone
        used.append(lane)
        return item**2

    assert list(in_lanes(range(6), ("left", "right"), work)) == [0, 1, 4, 9, 16, 25]
    assert set(used) == {"left", "right"}


def test_one_lane_works_in_the_thread_of_the_caller_when_it_is_asked() -> None:
    def work(lane: str, item: int) -> tuple[int, int]:
        return item, threading.get_ident()

    coming = in_lanes(iter(range(3)), ("only",), work)
    assert next(coming) == (0, threading.get_ident())


@pytest.mark.parametrize("lanes", [("only",), ("left", "right")])
def test_an_error_comes_after_the_items_before_it_and_ends_all(lanes: tuple[str, ...]) -> None:
    begun: list[int] = []

    def work(lane: str, item: int) -> int:
        begun.append(item)
        if item == 1:
            raise OSError("the disk is gone")
        return item

    coming = in_lanes(range(1000), lanes, work)
    assert next(coming) == 0
    with pytest.raises(OSError, match="the disk is gone"):
        list(coming)
    assert len(begun) < 10


def test_who_wants_no_more_ends_the_work() -> None:
    begun: list[int] = []

    def work(lane: int, item: int) -> int:
        begun.append(item)
        return item

    coming = in_lanes(range(1000), (1, 2), work)
    assert next(coming) == 0
    coming.close()
    assert len(begun) < 10
