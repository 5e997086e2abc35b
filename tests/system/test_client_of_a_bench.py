"""A client, and a server process on the small simulated bench that is killed while a run is watched."""

from contextlib import ExitStack
from pathlib import Path

import pytest

from tests.support.command_line import told
from tests.support.server_process import ROOT, ServerProcess, eventually
from tomoshadow.client import ClientError, RigClient

pytestmark = [pytest.mark.network, pytest.mark.timeout(300)]

CURRENT_A = {"view1": 25.0, "view2": 9.9, "view3": 10.0, "view4": 26.0}
PLAN = f"""\
name = "from a file"
kind = "background"
shots = 2
rate_hz = 4
[pulse]
current_a = {{ {", ".join(f"{view} = {current_a}" for view, current_a in CURRENT_A.items())} }}
"""


def test_a_server_that_is_killed_while_a_run_is_watched_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    server = ServerProcess(tmp_path, ROOT / "configs" / "simulated_small.toml")
    with ExitStack() as at_end:
        at_end.callback(server.http.close)
        at_end.callback(server.kill)
        eventually(server.answers, "the server answers")
        url = str(server.http.base_url)
        plan = tmp_path / "plan.toml"
        plan.write_text(PLAN)
        assert told(capsys, "run", plan, "--server", url)["outcome"] == "completed"
        client = RigClient(url)
        run_id = client.start({"name": "long", "shots": 1000, "rate_hz": 2, "pulse": {"current_a": CURRENT_A}})
        events = client.follow(run_id, wait_s=120, absent_s=1)
        assert any(event.name == "shot_recorded" for event in events)
        server.kill()
        with pytest.raises(ClientError, match=f"is gone, and run {run_id} was under way: look at the rig"):
            list(client.follow(run_id, wait_s=120, absent_s=1))
        with pytest.raises(ClientError, match="use the hardware stop"):
            client.abort()
