"""Once: a request with a key is obeyed once, however often it comes; the answer is the same every time."""

import threading
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, TypeVar

from server.lab.errors import Conflict, Unprocessable

_KEPT = 1000

Answer = TypeVar("Answer")


class Once:
    """Remembers the newest requests that had a key, and what came of them."""

    def __init__(self, kept: int = _KEPT) -> None:
        self._kept = kept
        self._lock = threading.Lock()
        self._known: dict[str, tuple[str, Future[Any]]] = {}

    def do(self, key: str | None, what: str, action: Callable[[], Answer]) -> Answer:
        """Do it, or answer as at the first time: with the same result, or the same error.

        Parameters
        ----------
        key : str | None
            Chosen by who asks, anew for everything that he asks; None: do it in any case.
        what : str
            The whole request: one key for two different ones is a mistake.

        Raises
        ------
        Conflict
            The same request is being worked on.
        Unprocessable
            The key was used for another request.
        """
        if key is None:
            return action()
        answer, is_new = self._remembered(key, what)
        if is_new:
            _work_out(answer, action)
        elif not answer.done():
            raise Conflict(f"the request with idempotency key {key!r} is being worked on", "in_progress")
        result: Answer = answer.result()
        return result

    def _remembered(self, key: str, what: str) -> tuple[Future[Any], bool]:
        with self._lock:
            known = self._known.get(key)
            if known is None:
                answer = Future[Any]()
                self._known[key] = what, answer
                for oldest in list(self._known)[: -self._kept]:
                    del self._known[oldest]
                return answer, True
        if known[0] != what:
            raise Unprocessable(f"idempotency key {key!r} was used for another request: choose a new one", "key_reused")
        return known[1], False


def _work_out(answer: Future[Any], action: Callable[[], Any]) -> None:
    try:
        answer.set_result(action())
    except Exception as error:  # noqa: BLE001  whatever it is, it is the answer
        answer.set_exception(error)
