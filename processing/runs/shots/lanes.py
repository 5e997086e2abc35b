"""in_lanes: items that are worked on side by side, each in a lane with memory of its own, and come in their order."""

from collections import deque
from collections.abc import Callable, Generator, Iterable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from queue import SimpleQueue
from typing import TypeVar

Item = TypeVar("Item")
Lane = TypeVar("Lane")
Made = TypeVar("Made")


def in_lanes(
    items: Iterable[Item], lanes: Sequence[Lane], work: Callable[[Lane, Item], Made]
) -> Generator[Made, None, None]:
    """Yield what is made of items, or raise the error of the first that fails; no lane works for two items at a time.

    A single lane works in the thread of the caller. No more items are under way, or wait for those before them, than
    two per lane.
    """
    if len(lanes) == 1:
        yield from (work(lanes[0], item) for item in items)
        return
    free: SimpleQueue[Lane] = SimpleQueue()
    for lane in lanes:
        free.put(lane)

    def work_in_one(item: Item) -> Made:
        lane = free.get()
        try:
            return work(lane, item)
        finally:
            free.put(lane)

    coming: deque[Future[Made]] = deque()
    with ThreadPoolExecutor(len(lanes), "lane") as pool:
        try:
            for item in items:
                coming.append(pool.submit(work_in_one, item))
                if len(coming) == 2 * len(lanes):
                    yield coming.popleft().result()
            while coming:
                yield coming.popleft().result()
        finally:
            pool.shutdown(wait=False, cancel_futures=True)
