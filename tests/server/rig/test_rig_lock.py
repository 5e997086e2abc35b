"""One process works with a rig: the second one is told who does, before it has touched a device."""

import json
import os
from pathlib import Path

import pytest

from daq.errors import AlreadyHeld
from server.cli.main import main
from server.doctor.checkup import Status
from server.doctor.doctor_rig import check_rig
from server.rig.assembly import open_generator, open_rig, wire_rig
from server.rig.config import ConfigError, RigConfig, load_config
from server.rig.rig_lock import hold_data_dir, hold_rig

SMALL = Path("configs/simulated_small.toml")


def real_rig(tmp_path: Path, *ips: str) -> RigConfig:
    """A rig that is not simulated, at addresses where nobody is."""
    described = load_config(SMALL).model_dump(exclude={"simulation"})
    views = dict(zip(("view1", "view2"), described["views"].values(), strict=False))
    for view, ip in zip(views.values(), ips, strict=True):
        view["camera"]["ip"] = ip
    described |= {"views": views, "interlock": {"chip": "/dev/gpiochip-none", "line": 1}, "stage": None}
    described["pulse_generator"] = {"port": str(tmp_path / "generator")}
    return RigConfig.model_validate(described, context={"folder": Path()})


def test_a_rig_is_held_by_one_process_and_so_is_each_device_of_it(tmp_path: Path) -> None:
    rig = real_rig(tmp_path, "10.9.9.1", "10.9.9.2")
    with hold_rig(rig):
        with pytest.raises(AlreadyHeld, match=f"is held by process {os.getpid()}, since "), wire_rig(rig):
            pass
        with pytest.raises(AlreadyHeld, match=f"port {tmp_path}/generator is held"), open_generator(rig):
            pass
        same_camera = real_rig(tmp_path / "other", "10.9.9.3", "10.9.9.2")
        with pytest.raises(AlreadyHeld, match=r"camera 10\.9\.9\.2 of network \d+ is held"), open_rig(same_camera):
            pass
        with hold_rig(real_rig(tmp_path / "third", "10.9.9.5", "10.9.9.6")):
            pass
    with hold_rig(rig):
        pass


def test_another_name_of_a_port_is_the_same_port(tmp_path: Path) -> None:
    (tmp_path / "by-id").symlink_to(tmp_path / "generator")
    rig = real_rig(tmp_path, "10.9.9.1", "10.9.9.2")
    generator = rig.pulse_generator
    assert generator is not None
    alias = rig.model_copy(update={"pulse_generator": generator.model_copy(update={"port": str(tmp_path / "by-id")})})
    with hold_rig(rig), pytest.raises(AlreadyHeld, match="port"), open_generator(alias):
        pass


def test_the_doctor_leaves_a_rig_alone_that_is_at_work(tmp_path: Path) -> None:
    rig = real_rig(tmp_path, "10.9.9.1", "10.9.9.2")
    with hold_rig(rig):
        (check,) = check_rig(rig)
    assert (check.name, check.status) == ("rig", Status.WARN)
    assert f"is held by process {os.getpid()}" in check.detail


def test_a_data_directory_is_held_by_one_process(tmp_path: Path) -> None:
    held = pytest.raises(AlreadyHeld, match=f"{tmp_path}/runs is held by process")
    with hold_data_dir(tmp_path / "runs"), held, hold_data_dir(tmp_path / "runs"):
        pass


def test_a_data_directory_that_cannot_be_made_is_named_with_the_reason(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises((ConfigError, OSError)) as refused, hold_data_dir(tmp_path / "file" / "runs"):
        pass
    reason = "cannot be made (not a directory): name another folder"
    assert str(refused.value) == f"data directory {tmp_path}/file/runs: {reason}"


def test_the_demonstration_does_not_record_into_a_folder_that_is_in_use(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with hold_data_dir(tmp_path / "runs"):
        assert main(["demo", "--config", str(SMALL), "--out", str(tmp_path), "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["kind"] == "AlreadyHeld"
