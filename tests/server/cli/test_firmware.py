"""``tomoshadow firmware`` on the simulated bench, through the command line."""

import io
import json
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from daq.simulation.pico.firmware_process import FirmwareProcess
from server.cli.firmware import described
from server.cli.main import main
from server.cli.output import train_table
from tests.server.rig.test_firmware_image import bootable, mounted, saved, uf2

CONFIG = ["--config", "configs/simulated_small.toml", "--json"]


def result_of(capsys: pytest.CaptureFixture[str], *arguments: str, status: int = 0) -> dict[str, Any]:
    assert main(["firmware", *arguments]) == status
    return dict(json.loads(capsys.readouterr().out.splitlines()[-1]))


def test_info_tells_identity_state_and_counters(capsys: pytest.CaptureFixture[str]) -> None:
    info = result_of(capsys, "info", *CONFIG)
    assert (info["identity"]["model"], info["identity"]["protocol"]) == ("tomoshadow-pulse", "4")
    assert (info["state"], info["faults"], info["start_cause"]) == ("SAFE", [], "POWER")
    assert info["identity"]["git"] == Path("build/firmware/revision").read_text().strip()
    assert info["interlock_closed"]
    assert info["estop_closed"]
    assert set(info["counters"].values()) == {0}
    assert info["limits"] == [
        {"channel": n, "max_current_ma": 30_000, "max_duty_ppm": 200, "max_light_ma": 500} for n in range(4)
    ]
    lines = described(info).splitlines()
    assert lines[0].startswith("identity: ")
    assert "state: SAFE, faults: none" in lines
    assert "interlock: closed, emergency stop: closed" in lines
    assert lines[-4].split() == ["0", "30000", "200", "500"]


@pytest.fixture
def generator(tmp_path: Path) -> Iterator[tuple[FirmwareProcess, list[str]]]:
    """One that outlives a command, and the configuration of a rig that has it."""
    config = Path(shutil.copytree("configs", tmp_path / "configs"), "spray4view.toml")
    with FirmwareProcess({}, lambda _: None) as firmware:
        ours = f'port = "{firmware.port}"'
        text, found = re.subn(r'(?m)^port = "/dev/.*pulse_generator.*"$', ours, config.read_text())
        assert found == 1
        config.write_text(text)
        yield firmware, ["--config", str(config), "--json"]


def test_clear_acknowledges_what_is_over_and_nothing_else(
    capsys: pytest.CaptureFixture[str], generator: tuple[FirmwareProcess, list[str]]
) -> None:
    firmware, config = generator
    firmware.set_estop(closed=False)
    assert main(["firmware", "clear", *config]) == 1
    told = capsys.readouterr()
    assert "latched: ESTOP" in told.err
    assert "the emergency stop is open (error 22)" in told.out + told.err
    firmware.set_estop(closed=True)
    assert result_of(capsys, "info", *config)["faults"] == ["ESTOP"], "it stays until somebody has looked"
    cleared = result_of(capsys, "clear", *config)
    assert cleared == {"acknowledged": ["ESTOP"], "state": "SAFE", "faults": []}
    assert result_of(capsys, "clear", *config) == {"acknowledged": [], "state": "SAFE", "faults": []}
    info = result_of(capsys, "info", *config)
    assert (info["state"], info["shots_left"], info["counters"]["requested"]) == ("SAFE", 0, 0)


def test_clear_does_not_pretend_to_reach_the_generator_of_a_simulated_server(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["firmware", "clear", *CONFIG]) == 2
    told = capsys.readouterr()
    assert "on the page of the server that shows them" in told.out + told.err


def test_limits_of_board_and_rig_stand_side_by_side(capsys: pytest.CaptureFixture[str]) -> None:
    told = result_of(capsys, "limits", *CONFIG)
    assert (told["stored"], told["board"]) == ("NONE", [[30_000, 200, 500]] * 4)
    assert told["rig"][0] == [26_000, 200, 0]
    stored = result_of(capsys, "limits", "--store", *CONFIG)
    assert (stored["stored"], stored["board"]) == ("WHOLE", told["rig"])


def test_selftest_passes_and_lists_its_checks(capsys: pytest.CaptureFixture[str]) -> None:
    result = result_of(capsys, "selftest", *CONFIG)
    assert result["passed"] is True
    assert {check["verdict"] for check in result["checks"]} == {"ok", "skipped"}
    assert len(result["checks"]) >= 10


def test_selftest_with_light_asks_before_each_flash(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO("\ny\n" + "s\n" * 7))
    checks = result_of(capsys, "selftest", "--light", *CONFIG)["checks"][-8:]
    assert [check["name"] for check in checks[:2]] == ["pulses of view1", "pulses of view2"]
    assert [check["verdict"] for check in checks] == ["ok", *7 * ["skipped"]]


def test_selftest_fires_only_where_somebody_is_ready(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("daq.drivers.pulse_light_test.WAIT_S", 0.2)
    monkeypatch.setattr("sys.stdin", io.StringIO("no\nq\ny\n" * 9))
    checks = result_of(capsys, "selftest", "--light", *CONFIG)["checks"][-8:]
    assert {check["verdict"] for check in checks} == {"skipped"}


def test_selftest_fires_nothing_where_nobody_answers(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("daq.drivers.pulse_light_test.WAIT_S", 0.2)
    monkeypatch.setattr("sys.stdin", io.StringIO(""))
    assert "nobody answers" in result_of(capsys, "selftest", "--light", *CONFIG, status=2)["error"]


def test_a_failed_selftest_shows_in_the_exit_status(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A generator of another make: the name that the test expects is changed instead."""
    monkeypatch.setattr("daq.drivers.pulse_self_test.MODEL", "somebody else's")
    result = result_of(capsys, "selftest", *CONFIG, status=1)
    assert [check["name"] for check in result["checks"] if check["verdict"] == "fail"] == ["identity"]


def test_scope_writes_both_pictures_and_tells_both_values(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    out = tmp_path / "new" / "train.svg"
    result = result_of(capsys, "scope", *CONFIG, "-o", str(out), "--separation", "6405", "--width", "1003")
    assert Path(result["svg"]).read_bytes().startswith(b"<?xml")
    assert Path(result["png"]).read_bytes().startswith(b"\x89PNG")
    for view in result["views"].values():
        assert view["requested"]["pulse_b_ns"] == [6405, 7408]
        assert view["actual"]["pulse_b_ns"] == [6408, 7408], "6405 goes to 6408, 1003 to 1000"
    _heads, *lines = train_table(result["views"]).splitlines()
    assert [re.split(" {2,}", line)[:3] for line in lines] == [
        [name, "0 to 1000", "6408 to 7408"] for name in result["views"]
    ]


def test_scope_draws_a_plan(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    plan = tmp_path / "plan.json"
    currents = {"view1": 12.0, "view2": 0.0, "view3": 3.0, "view4": 4.0}
    plan.write_text(json.dumps({"name": "p", "shots": 3, "pulse": {"separation_ns": 9000, "current_a": currents}}))
    views = result_of(capsys, "scope", *CONFIG, "-o", str(tmp_path / "t.svg"), "--plan", str(plan))["views"]
    assert {name: view["actual"]["current_a"] for name, view in views.items()} == currents


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (["--separation", "2000", "--width", "2000"], "below"),
        (["--width", "5"], "width_ns"),
        (["--plan", "absent"], "absent"),
    ],
)
def test_bad_input_is_told_apart(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, options: list[str], reason: str
) -> None:
    result = result_of(capsys, "scope", *CONFIG, "-o", str(tmp_path / "t.svg"), *options, status=2)
    assert reason in result["error"]
    assert not (tmp_path / "t.svg").exists()


def test_flash_copies_a_checked_image(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    image, drive = saved(tmp_path, uf2(bootable())), mounted(tmp_path / "RPI-RP2")
    result = result_of(capsys, "flash", str(image), "--drive", str(drive), "--json")
    assert (result["version"], Path(result["written"]).read_bytes()) == ("1.2.3", image.read_bytes())


def test_flash_writes_nothing_that_it_would_not_start(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    image, drive = saved(tmp_path, bytes(512)), mounted(tmp_path / "RPI-RP2")
    result = result_of(capsys, "flash", str(image), "--drive", str(drive), "--json", status=2)
    assert "no UF2 block" in result["error"]
    assert [path.name for path in drive.iterdir()] == ["INFO_UF2.TXT"]


@pytest.fixture
def permissive(tmp_path: Path) -> list[str]:
    """The simulated rig with an LED whose data sheet permits continuous light."""
    text = (
        Path("configs/simulated_small.toml")
        .read_text()
        .replace("led_channel = 1\n", "led_channel = 1\nmax_light_a = 0.2\n")
    )
    config = Path(shutil.copytree("configs", tmp_path / "configs"), "permissive.toml")
    config.write_text(text)
    return ["--config", str(config), "--json"]


def test_light_lasts_as_long_as_asked(capsys: pytest.CaptureFixture[str], permissive: list[str]) -> None:
    result = result_of(capsys, "light", *permissive, "--current-a", "0.2", "--time-s", "0.05")
    assert result["views"] == ["view2"]


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (["--current-a", "0.21"], "above the limit that was set for this channel"),
        (["--current-a", "0.1", "--view", "view1"], "above the limit that was set for this channel"),
        (["--current-a", "0.1", "--view", "view9"], "view9"),
        (["--current-a", "0.1", "--time-s", "601"], "not for 1 to 600000 ms"),
    ],
)
def test_light_is_refused_beyond_what_the_rig_permits(
    capsys: pytest.CaptureFixture[str], permissive: list[str], options: list[str], reason: str
) -> None:
    assert main(["firmware", "light", *permissive, *options]) != 0
    assert reason in "".join(capsys.readouterr())


def test_no_led_gives_continuous_light_unless_its_limit_is_stated(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["firmware", "light", *CONFIG, "--current-a", "0.1"]) != 0
    assert "none has max_light_a" in "".join(capsys.readouterr())


def test_ctrl_c_ends_the_light(permissive: list[str]) -> None:
    """What would not be confirmed off is added to the error."""
    command = [sys.executable, "-m", "server.cli", "firmware", "light", *permissive, "--current-a", "0.1"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as tool:
        assert tool.stderr is not None
        assert "lit for 60 s at most" in tool.stderr.readline()
        tool.send_signal(signal.SIGINT)
        output, errors = tool.communicate(timeout=20)
    assert tool.returncode == 1
    assert "interrupted" in output + errors
    assert "not confirmed" not in output + errors
