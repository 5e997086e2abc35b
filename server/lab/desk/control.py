"""Control: of several people at one rig, one makes light, moves and changes; who wants it takes it over, and is seen.

What ends the light never asks for it.
"""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Protocol

from server.lab.desk.visitor import Role, Visitor
from server.lab.errors import Forbidden, Locked, Unprocessable

REMEDIES = {
    "control_held": "wait, or take control over: in the bar, by PUT /api/rig/control, or tomoshadow run --take-control",
    "viewer": "sign in with the token of an operator",
    "no_name": "say who you are: header Tomoshadow-Operator",
}
"""By code, for the operator."""
KEPT_S = 600.0
"""After the last action, or the end of the run."""


class Tell(Protocol):
    """Publishes an event."""

    def __call__(self, name: str, **data: object) -> object: ...  # noqa: D102


@dataclass(frozen=True)
class Holder:
    """Who holds control, and for how long if he does nothing."""

    who: Visitor
    left_s: float


class Control:
    """Held by nobody at first; from any thread.

    Parameters
    ----------
    is_busy : Callable[[], bool]
        Whether a run or a live view is under way: its control does not run out.
    tell : Tell
        Told of every change.
    now_s : Callable[[], float]
        A clock that never goes back.
    """

    def __init__(self, is_busy: Callable[[], bool], tell: Tell, now_s: Callable[[], float] = time.monotonic) -> None:
        self._is_busy = is_busy
        self._tell = tell
        self._now_s = now_s
        self._lock = threading.RLock()
        self._who: Visitor | None = None
        self._last_s = 0.0

    @property
    def holder(self) -> Holder | None:
        """Who holds it now."""
        with self._lock:
            if self._is_busy():
                self._last_s = self._now_s()
            left_s = self._last_s + KEPT_S - self._now_s()
            if self._who is not None and left_s <= 0:
                self._change(None)
            return Holder(self._who, left_s) if self._who else None

    def check(self, who: Visitor) -> None:
        """Refuse who may not act now.

        Raises
        ------
        Forbidden
            A viewer.
        Locked
            Somebody else holds control.
        """
        if who.role is Role.VIEWER:
            raise Forbidden(f"{who.name} may look and end the light, and do nothing else", "viewer")
        holder = self.holder
        if holder is not None and holder.who.id != who.id:
            raise Locked(f"{holder.who.name} holds control of this rig", "control_held")

    def require(self, who: Visitor) -> None:
        """Let somebody act, who holds control from now on; raises what ``check`` does."""
        with self._lock:
            self.check(who)
            if who.id:
                self._hold(who)

    @contextmanager
    def acting(self, who: Visitor) -> Iterator[None]:
        """Let somebody act, as ``require``; who took it for what fails gives it back."""
        with self._lock:
            was_free = self.holder is None
            self.require(who)
        try:
            yield
        except Exception:
            if was_free:
                self.release(who)
            raise

    def take(self, who: Visitor) -> None:
        """Take control, from whoever holds it.

        Raises
        ------
        Forbidden
            A viewer.
        Unprocessable
            A script that does not say who runs it.
        """
        if who.role is Role.VIEWER:
            raise Forbidden(f"{who.name} may look and end the light, and do nothing else", "viewer")
        if not who.id:
            raise Unprocessable("control is held by somebody with a name", "no_name")
        with self._lock:
            self._hold(who)

    def release(self, who: Visitor) -> None:
        """Give control back; nothing happens where another one holds it."""
        with self._lock:
            if self._who is not None and self._who.id == who.id:
                self._change(None)

    def _hold(self, who: Visitor) -> None:
        self._last_s = self._now_s()
        if self._who != who:
            self._change(who)

    def _change(self, who: Visitor | None) -> None:
        before, self._who = self._who, who
        holder, former = (one.name if one else "" for one in (who, before))
        self._tell("control", holder=holder, before=former, text=_told(holder, former))


def _told(holder: str, before: str) -> str:
    """Who took control from whom."""
    if not holder:
        return f"{before} no longer holds control"
    return f"{holder} has taken control from {before}" if before else f"{holder} holds control"
