"""``run``, ``watch``, ``runs``, ``stop`` and ``abort`` ask a real socket, with a rig in memory behind it."""

import json
import re
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from server.cli.clients.plan_file import read_plan
from server.cli.main import main
from tests.support.command_line import refused, shown, told
from tests.support.server_process import ENVIRONMENT, ROOT, free_port
from tests.support.serving import DEADLINE_S, Serving, plan_of, serving

PLAN = """\
name = "from a file"
shots = {shots}
rate_hz = {rate_hz}

[pulse]
current_a = {{ view1 = 5, view2 = 5 }}
"""


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Serving]:
    with serving(tmp_path_factory.mktemp("data")) as running:
        yield running


@pytest.fixture
def at_server(server: Serving) -> Iterator[list[str]]:
    """Options that name it; the rig is at rest at the end."""
    yield ["--server", f"http://127.0.0.1:{server.port}"]
    server.services.acquisition.abort()
    server.wait()


@pytest.fixture
def plan(tmp_path: Path) -> Path:
    file = tmp_path / "plan.toml"
    file.write_text(PLAN.format(shots=3, rate_hz=20))
    return file


def failed(capsys: pytest.CaptureFixture[str], *arguments: object) -> dict[str, Any]:
    assert main([*map(str, arguments), "--json"]) == 1
    error: dict[str, Any] = json.loads(capsys.readouterr().out.splitlines()[-1])
    return error


def test_run_starts_a_plan_and_shows_it_to_its_end(
    capsys: pytest.CaptureFixture[str], at_server: list[str], plan: Path
) -> None:
    assert main(["run", str(plan), *at_server, "--json"]) == 0
    output = capsys.readouterr()
    result = json.loads(output.out.splitlines()[-1])
    assert (result["outcome"], result["shots_valid"], result["name"]) == ("completed", 3, "from a file")
    assert "Ctrl-C ends the watching, and not the run" in output.err
    assert f"run {result['run_id']}: completed, 3 of 3 shots recorded, 3 valid" in output.err
    assert result["run_id"] in shown(capsys, "runs", *at_server)
    newest = told(capsys, "runs", *at_server, "--limit", 1)["runs"]
    assert [run["run_id"] for run in newest] == [result["run_id"]]
    assert told(capsys, "watch", result["run_id"], *at_server)["outcome"] == "completed"


def test_a_wrong_plan_is_told_with_its_line_and_nothing_is_asked(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    nobody = ["--server", f"http://127.0.0.1:{free_port()}"]
    file = tmp_path / "plan.toml"
    assert refused(capsys, "run", file, *nobody) == f"{file}: No such file or directory"
    file.write_text(PLAN.format(shots=0, rate_hz=20).replace("[pulse]", "[pulse]\nwidht_ns = 500"))
    text = refused(capsys, "run", file, *nobody)
    assert f"{file}:2: shots: Input should be greater than or equal to 1" in text
    assert f"{file}:6: pulse.widht_ns: Extra inputs are not permitted" in text
    file.write_text("name = = 1")
    assert "line 1" in refused(capsys, "run", file, *nobody)


def test_the_plan_of_the_page_is_one(tmp_path: Path) -> None:
    page = (ROOT / "docs" / "operate.md").read_text()
    (text,) = (
        block for block in re.findall(r"^```toml\n(.*?)^```", page, re.DOTALL | re.MULTILINE) if "shots" in block
    )
    file = tmp_path / "plan.toml"
    file.write_text(text)
    assert read_plan(file)["shots"] == 12


def test_a_plan_that_the_rig_cannot_run_is_bad_input(
    capsys: pytest.CaptureFixture[str], at_server: list[str], plan: Path
) -> None:
    plan.write_text(plan.read_text().replace("rate_hz", 'references = ["no-run"]\nrate_hz'))
    assert "no-run" in refused(capsys, "run", plan, *at_server)


def test_a_busy_rig_fails_with_code_and_remedy(
    server: Serving, capsys: pytest.CaptureFixture[str], at_server: list[str], plan: Path
) -> None:
    server.http.post("/api/runs", json=plan_of(shots=1000, rate_hz=5.0))
    error = failed(capsys, "run", plan, *at_server)
    assert error["code"] == "busy"
    assert error["error"].endswith("wait for its end, or stop it")


def test_abort_is_confirmed(server: Serving, capsys: pytest.CaptureFixture[str], at_server: list[str]) -> None:
    server.http.post("/api/runs", json=plan_of(shots=1000, rate_hz=5.0))
    assert told(capsys, "abort", *at_server)["light"] == "off"
    assert server.wait().outcome == "aborted"
    assert "light off confirmed" in shown(capsys, "abort", *at_server, "--abort-port", server.abort_listener.port)


def test_stop_ends_the_run_after_its_shot(
    server: Serving, capsys: pytest.CaptureFixture[str], at_server: list[str]
) -> None:
    assert "no run is under way" in shown(capsys, "stop", *at_server)
    started = server.http.post("/api/runs", json=plan_of(shots=1000, rate_hz=5.0))
    assert started.headers["location"].endswith(told(capsys, "stop", *at_server)["run_id"])
    assert server.wait().outcome == "stopped"


def test_run_holds_control_while_it_lasts_and_takes_it_over_only_when_asked_to(
    server: Serving, capsys: pytest.CaptureFixture[str], at_server: list[str], plan: Path
) -> None:
    bob = {"Tomoshadow-Operator": "bob@lab"}
    server.http.put("/api/rig/control", headers=bob)
    error = failed(capsys, "run", plan, *at_server)
    assert (error["code"], "bob@lab holds control" in error["error"]) == ("control_held", True)
    assert "--take-control" in error["error"]
    told(capsys, "run", plan, *at_server, "--take-control")
    assert server.http.get("/api/rig/control").json()["holder"] is None
    holders = [event.data["holder"] for event in server.services.events.since(0) if event.name == "control"]
    assert holders[-1] == ""
    assert "@" in holders[-2]
    assert holders[-2] != "bob@lab"


def test_without_a_server_every_command_says_what_to_do(capsys: pytest.CaptureFixture[str], plan: Path) -> None:
    nobody = ["--server", f"http://127.0.0.1:{free_port()}"]
    for words in (["run", plan], ["watch"], ["runs"]):
        error = failed(capsys, *words, *nobody)
        assert error["code"] == "unreachable"
        assert "start it with tomoshadow serve" in error["error"]
    error = failed(capsys, "abort", *nobody)
    assert error["error"].startswith("NOT DELIVERED (")
    assert error["error"].endswith("use the hardware stop")
    assert "is no address" in refused(capsys, "runs", "--server", "rig:8080")


def test_a_rig_file_names_its_server(server: Serving, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    text = (ROOT / "configs" / "simulated_small.toml").read_text()
    config = tmp_path / "rig.toml"
    text = text.replace('"cameras/', f'"{ROOT}/configs/cameras/')
    config.write_text(text.replace("port = 8080", f"port = {server.port}"))
    state = told(capsys, "watch", "--config", config)
    assert state == {"run_id": None, "state": "ready"}
    with pytest.raises(SystemExit):
        main(["watch", "--config", str(config), "--server", "http://127.0.0.1:1"])


def test_ctrl_c_ends_the_watching_and_not_the_run(server: Serving, at_server: list[str]) -> None:
    run_id = server.http.post("/api/runs", json=plan_of(shots=1000, rate_hz=5.0)).json()["run_id"]
    command = [sys.executable, "-m", "server.cli", "watch", *at_server, "--json"]
    with subprocess.Popen(
        command, cwd=ROOT, env=ENVIRONMENT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as watching:
        assert watching.stderr is not None
        assert run_id in watching.stderr.readline()
        assert watching.stderr.readline().startswith("shot ")
        watching.send_signal(signal.SIGINT)
        out, err = watching.communicate(timeout=DEADLINE_S)
    assert watching.returncode == 1
    assert json.loads(out) == {"passed": False, "run_id": run_id, "outcome": "active"}
    assert f"run {run_id} goes on" in err
    assert "tomoshadow abort --server" in err
    assert server.http.get(f"/api/runs/{run_id}").json()["outcome"] == "active"


def test_ctrl_c_while_a_start_is_asked_for_says_how_to_find_out(plan: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as silent:
        url = f"http://127.0.0.1:{silent.getsockname()[1]}"
        command = [sys.executable, "-m", "server.cli", "run", str(plan), "--server", url]
        with subprocess.Popen(command, cwd=ROOT, env=ENVIRONMENT, stdout=subprocess.PIPE, text=True) as starting:
            visitor, _ = silent.accept()
            with visitor:
                starting.send_signal(signal.SIGINT)
                out, _ = starting.communicate(timeout=DEADLINE_S)
    assert starting.returncode == 1
    assert f"tomoshadow watch --server {url} tells whether the run is under way" in out
