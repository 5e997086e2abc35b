import os
import signal
import subprocess
import sys
from pathlib import Path

import httpx
import pytest

from tests.support.serving import DEADLINE_S

SCRIPT = """
import sys
from contextlib import contextmanager
from pathlib import Path
import uvicorn
from server.web.app import create_app, serve
from server.web.port import listening
from tests.support import serving

def talkative_serve(services):
    app = create_app(services)
    started = uvicorn.Server.startup
    async def startup(server, sockets=None):
        await started(server, sockets)
        print(server.servers[0].sockets[0].getsockname()[1], flush=True)
    uvicorn.Server.startup = startup
    with listening("127.0.0.1", 0) as listener:
        serve(app, listener)
    print("served", flush=True)

with serving.assembled(Path(sys.argv[1])) as services:
    talkative_serve(services)
print("closed", flush=True)
"""


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_ends_the_server_and_its_caller_can_close_the_devices(tmp_path: Path, number: signal.Signals) -> None:
    command = [sys.executable, "-c", SCRIPT, str(tmp_path / "runs")]
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[3])}
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as process:
        assert process.stdout is not None
        port = int(process.stdout.readline())
        url = f"http://127.0.0.1:{port}/api/events"
        with httpx.stream("GET", url, timeout=DEADLINE_S) as stream:
            assert stream.status_code == 200
            process.send_signal(number)
            assert process.stdout.read().split() == ["served", "closed"]
        assert process.wait(DEADLINE_S) == 0
