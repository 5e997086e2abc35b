"""Progress: who waits may see how far long work is; the work knows no more than that its steps are counted."""

from collections.abc import Callable, Iterable, Sequence
from typing import Protocol, TypeVar

T = TypeVar("T")


class Counted(Protocol):
    """Gives items one by one and tells somebody, before each, how many are done and what is done with it."""

    def __call__(self, items: Sequence[T], text: Callable[[T], str], /) -> Iterable[T]:
        """Items as they are; ``text`` says what is done with one."""


def in_silence(items: Sequence[T], _text: Callable[[T], str], /) -> Iterable[T]:
    """Nobody waits."""
    return items
