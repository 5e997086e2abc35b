"""A server in a process of its own, which may be killed."""

import os
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx

ROOT = Path(__file__).parents[2]
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(ROOT)}
LIMIT_S = 120.0


class ServerProcess:
    """``tomoshadow serve`` at a free port.

    Parameters
    ----------
    work_dir : Path
        Where it runs; it says there what it has to say, in serve.log.
    config : Path
        Rig file.
    """

    def __init__(self, work_dir: Path, config: Path) -> None:
        port = free_port()
        command = [sys.executable, "-m", "server.cli", "serve", "--config", str(config), "--port", str(port)]
        with (work_dir / "serve.log").open("a") as log:
            self._process = subprocess.Popen(command, cwd=work_dir, env=ENVIRONMENT, stderr=log, stdout=log)
        self.http = httpx.Client(base_url=f"http://127.0.0.1:{port}", timeout=LIMIT_S)

    def answers(self) -> bool:
        """It is up."""
        if self._process.poll() is not None:
            raise AssertionError(f"the server ended with {self._process.returncode}: see serve.log")
        try:
            return self.http.get("/api/rig").status_code == 200
        except httpx.TransportError:
            return False

    @property
    def pid(self) -> int:
        """Process id."""
        return self._process.pid

    @property
    def rss_kib(self) -> float:
        """Memory that it occupies."""
        status = Path(f"/proc/{self.pid}/status").read_text()
        return float(status.partition("VmRSS:")[2].split()[0])

    def kill(self) -> None:
        """End it without a warning."""
        self._process.kill()
        self._process.wait(LIMIT_S)


@contextmanager
def stopped_at_end(process: subprocess.Popen[Any]) -> Iterator[None]:
    """Ask a process to end when the block does, and wait for it."""
    try:
        yield
    finally:
        process.terminate()
        process.wait(LIMIT_S)


def eventually(is_so: Callable[[], bool], what: str, why: Callable[[], str] = str) -> None:
    """Wait until something is so; says why not, if that can be said."""
    end_s = time.monotonic() + LIMIT_S
    while not is_so():
        if time.monotonic() > end_s:
            raise AssertionError(f"waited {LIMIT_S} s until {what}: {why()}")
        time.sleep(0.05)


def free_port() -> int:
    """A port of the loopback interface that nobody listens at."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])
