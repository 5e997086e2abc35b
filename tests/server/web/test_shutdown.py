import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import httpx
import pytest

from daq.files.run_directory import RunReader
from tests.support.serving import DEADLINE_S, plan_of

SCRIPT = """
import sys
import threading
from contextlib import contextmanager
from functools import partial
from pathlib import Path
import uvicorn
from server.web.app import create_app, serve
from server.web.port import listening
from server.web.serve import leave
from tests.support import serving

def talkative_serve(services):
    app = create_app(services)
    started = uvicorn.Server.startup
    async def startup(server, sockets=None):
        await started(server, sockets)
        if threading.current_thread() is threading.main_thread():
            print(server.servers[0].sockets[0].getsockname()[1], flush=True)
    uvicorn.Server.startup = startup
    with listening("127.0.0.1", 0) as listener:
        serve(app, listener, partial(leave, services.acquisition, services.events))
    print("served", flush=True)

with serving.assembled(Path(sys.argv[1])) as services:
    talkative_serve(services)
print("closed", flush=True)
"""


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_ends_the_server_and_its_caller_can_close_the_devices(tmp_path: Path, number: signal.Signals) -> None:
    with _server(tmp_path) as process:
        assert process.stdout is not None
        port = int(process.stdout.readline())
        url = f"http://127.0.0.1:{port}/api/events"
        with httpx.stream("GET", url, timeout=DEADLINE_S) as stream:
            assert stream.status_code == 200
            process.send_signal(number)
            assert process.stdout.read().split() == ["served", "closed"]
        assert process.wait(DEADLINE_S) == 0


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_ends_the_run_by_its_name(tmp_path: Path, number: signal.Signals) -> None:
    with _server(tmp_path) as process:
        assert process.stdout is not None
        port = int(process.stdout.readline())
        plan = plan_of(shots=1000, rate_hz=5)
        answer = httpx.post(f"http://127.0.0.1:{port}/api/runs", json=plan, timeout=DEADLINE_S)
        run_dir = tmp_path / "runs" / answer.json()["run_id"]
        process.send_signal(number)
        assert process.wait(DEADLINE_S) == 0
    reader = RunReader(run_dir)
    assert (reader.outcome, reader.cause) == ("aborted", f"the server was ended by {number.name}")


def test_a_reader_of_events_sees_how_it_ended_and_holds_up_nothing(tmp_path: Path) -> None:
    with _server(tmp_path) as process:
        assert process.stdout is not None
        url = f"http://127.0.0.1:{int(process.stdout.readline())}/api"
        with httpx.stream("GET", f"{url}/events", timeout=DEADLINE_S) as stream:
            httpx.post(f"{url}/runs", json=plan_of(shots=1000, rate_hz=5), timeout=DEADLINE_S)
            process.send_signal(signal.SIGTERM)
            seen: list[str] = []
            with suppress(httpx.RemoteProtocolError):  # the stream was cut off
                seen += stream.iter_lines()
        _, said = process.communicate(timeout=DEADLINE_S)
        assert "Traceback" not in said
        assert any('"outcome": "aborted"' in line for line in seen)


@contextmanager
def _server(folder: Path) -> Iterator[subprocess.Popen[str]]:
    command = [sys.executable, "-c", SCRIPT, str(folder / "runs")]
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[3])}
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment
    ) as process:
        yield process
