"""Sessions: browsers that were let in. What a browser keeps is a random word, and no token."""

import secrets
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

from server.lab.desk.visitor import Role, Visitor

KEPT_S = 12 * 3600.0
"""After the last request."""
_MOST = 1000


@dataclass(frozen=True)
class _Session:
    visitor: Visitor
    seen_s: float


class Sessions:
    """Kept in memory: a restart of the server ends them; from any thread.

    Parameters
    ----------
    now_s : Callable[[], float]
        A clock that never goes back.
    """

    def __init__(self, now_s: Callable[[], float] = time.monotonic) -> None:
        self._now_s = now_s
        self._lock = threading.Lock()
        self._known: dict[str, _Session] = {}
        self._begun = 0

    def begin(self, role: Role, address: str, name: str = "") -> Visitor:
        """Let a browser in; without a name it gets a number."""
        with self._lock:
            self._begun += 1
            named = _readable(name) or f"{role} {self._begun} at {address}"
            visitor = Visitor(secrets.token_urlsafe(32), named, role)
            self._known[visitor.id] = _Session(visitor, self._now_s())
            for oldest in sorted(self._known, key=lambda one: self._known[one].seen_s)[:-_MOST]:
                del self._known[oldest]
        return visitor

    def find(self, session_id: str) -> Visitor | None:
        """Whose session that is, which goes on; None where there is none, or it is over."""
        with self._lock:
            session = self._known.get(session_id)
            if session is None:
                return None
            if self._now_s() - session.seen_s > KEPT_S:
                del self._known[session_id]
                return None
            self._known[session_id] = replace(session, seen_s=self._now_s())
            return session.visitor

    def rename(self, session_id: str, name: str) -> Visitor | None:
        """The operator says who he is."""
        visitor = self.find(session_id)
        if visitor is None or not _readable(name):
            return visitor
        visitor = replace(visitor, name=_readable(name))
        with self._lock:
            self._known[session_id] = _Session(visitor, self._now_s())
        return visitor

    def end(self, session_id: str) -> None:
        """Sign out."""
        with self._lock:
            self._known.pop(session_id, None)


def _readable(name: str) -> str:
    """A name as others are told it: one line, without what hides or turns letters."""
    return "".join(letter for letter in name if letter.isprintable()).strip()[:40]
