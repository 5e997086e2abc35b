"""Once: a request with a key is obeyed once, however often it comes; the answer is the same every time."""

import hashlib
import threading
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, TypeVar

from pydantic import BaseModel

from server.lab.desk.request_table import RequestTable
from server.lab.errors import Conflict, Unprocessable

_KEPT = 1000

Answer = TypeVar("Answer")


def described(what: str, request: BaseModel) -> str:
    """A whole request as text: all that was said, and nothing that was not, so that a later program says the same."""
    return f"{what} {request.model_dump_json(exclude_unset=True)}"


class Once:
    """Remembers the newest requests that had a key, and what came of them.

    Parameters
    ----------
    kept : int
        How many of them.
    table : RequestTable | None
        Where they are kept for the next life of the server; None: they are not.
    """

    def __init__(self, kept: int = _KEPT, table: RequestTable | None = None) -> None:
        self._kept = kept
        self._table = table
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
        action : Callable[[], Answer]
            Its answer is made of what JSON knows.

        Raises
        ------
        Conflict
            The same request is being worked on, or was when the server died.
        Unprocessable
            The key was used for another request.
        """
        if key is None:
            return action()
        digest = hashlib.sha256(what.encode()).hexdigest()  # a plan may have a megabyte
        answer, is_new = self._remembered(key, digest)
        if is_new:
            self._work_out(key, digest, answer, action)
        elif not answer.done():
            raise Conflict(f"the request with idempotency key {key!r} is being worked on", "in_progress")
        if error := answer.exception():
            raise error.with_traceback(None)  # or it would grow with every time that it is raised
        result: Answer = answer.result()
        return result

    def _remembered(self, key: str, what: str) -> tuple[Future[Any], bool]:
        with self._lock:
            known = self._known.get(key) or self._of_another_life(key)
            if known is None:
                answer = Future[Any]()
                self._known[key] = what, answer
                for oldest in list(self._known)[: -self._kept]:
                    del self._known[oldest]
                return answer, True
        if known[0] != what:
            raise Unprocessable(f"idempotency key {key!r} was used for another request: choose a new one", "key_reused")
        return known[1], False

    def _of_another_life(self, key: str) -> tuple[str, Future[Any]] | None:
        obeyed = self._table.find(key) if self._table else None
        if obeyed is None:
            return None
        answer = Future[Any]()
        if obeyed.is_answered:
            answer.set_result(obeyed.answer)
        else:
            text = f"the server ended while it worked on the request with idempotency key {key!r}"
            answer.set_exception(Conflict(text, "outcome_unknown"))
        return obeyed.what, answer

    def _work_out(self, key: str, what: str, answer: Future[Any], action: Callable[[], Any]) -> None:
        if self._table:
            self._table.begin(key, what)
        try:
            result = action()
        except Exception as error:  # noqa: BLE001  whatever it is, it is the answer
            if self._table:
                self._table.drop(key)
            answer.set_exception(error)
            return
        if self._table:
            self._table.end(key, result)
        answer.set_result(result)
