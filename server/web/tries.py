"""Tries: whoever offers wrong tokens waits, so that nobody finds one by trying."""

import ipaddress
import math
import threading
import time
from collections import deque
from collections.abc import Callable

MOST = 20
WITHIN_S = 60.0
_ADDRESSES = 1000


def home_of(address: str) -> str:
    """Who is behind an address: of IPv6, every computer has 2**64 of them, which are one home."""
    try:
        parsed = ipaddress.ip_address(address)
    except ValueError:
        return address
    if parsed.version == 4:
        return address
    return str(parsed.ipv4_mapped or ipaddress.ip_network((int(parsed) >> 64 << 64, 64)))


class Tries:
    """Wrong tokens of the last minute, by home; from any thread.

    Parameters
    ----------
    now_s : Callable[[], float]
        A clock that never goes back.
    """

    def __init__(self, now_s: Callable[[], float] = time.monotonic) -> None:
        self._now_s = now_s
        self._lock = threading.Lock()
        self._wrong: dict[str, deque[float]] = {}

    def wait_s(self, address: str) -> int:
        """How long an address has to wait before it is listened to again; 0: it need not."""
        with self._lock:
            wrong = self._wrong.get(home_of(address), deque())
            left_s = wrong[0] + WITHIN_S - self._now_s() if len(wrong) == MOST else 0.0
        return max(0, math.ceil(left_s))

    def count(self, address: str) -> None:
        """Remember that an address has offered a wrong one."""
        home = home_of(address)
        with self._lock:
            wrong = self._wrong.pop(home, None) or deque(maxlen=MOST)
            wrong.append(self._now_s())
            self._wrong[home] = wrong
            for oldest in list(self._wrong)[:-_ADDRESSES]:
                del self._wrong[oldest]
