"""``tomoshadow`` whose main thread does nothing else for a while after SIGUSR1: what ABORT must not wait for."""

import runpy
import signal
import time

BUSY_S = 3.0


def _be_busy(*_: object) -> None:
    """With the lock of the interpreter, as work would be."""
    end_s = time.monotonic() + BUSY_S
    while time.monotonic() < end_s:
        pass


if __name__ == "__main__":
    signal.signal(signal.SIGUSR1, _be_busy)
    runpy.run_module("server.cli", run_name="__main__")
