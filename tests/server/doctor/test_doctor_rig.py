"""What the doctor says of rigs: the simulated bench is sound; what is broken is named, device by device."""

import json
from pathlib import Path
from typing import Any

import pytest

from daq.drivers.aravis_device import AravisDevice
from daq.simulation.interlock import MemoryInterlock
from server.cli.main import main
from server.doctor.checkup import Checkup, Status
from server.doctor.doctor_rig import check_camera, check_interlock, check_network, check_rig
from server.rig.assembly import wire_rig
from server.rig.config import RigConfig, load_config

pytestmark = pytest.mark.network

SMALL = Path("configs/simulated_small.toml")


def two_views() -> RigConfig:
    config = load_config(SMALL)
    return config.model_copy(update={"views": {name: config.views[name] for name in ("view1", "view2")}})


def real_rig_without_devices() -> RigConfig:
    """Two views as if they were real: nobody at their addresses, nothing at the ports."""
    described = two_views().model_dump(exclude={"simulation"})
    described["pulse_generator"] = {"port": "/dev/ttyACM-none"}
    described["interlock"] = {"chip": "/dev/gpiochip-none", "line": 1}
    described["stage"]["port"] = "/dev/ttyUSB-none"
    return RigConfig.model_validate(described, context={"folder": Path()})


def by_name(checks: list[Checkup]) -> dict[str, Checkup]:
    return {check.name: check for check in checks}


def test_the_simulated_bench_is_sound(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["doctor", "--config", str(SMALL), "--json"]) == 0
    checks: list[dict[str, Any]] = json.loads(capsys.readouterr().out.splitlines()[-1])["checks"]
    assert checks[0]["detail"].endswith("simulated spray4view, binned, 4 views")
    told = {check["name"]: check for check in checks}
    for view in ("view1", "view2", "view3", "view4"):
        assert told[f"network of {view}"]["detail"].endswith("by lo, MTU 65536")
        assert told[f"camera of {view}"]["status"] == "ok"
    assert told["pulse generator"]["detail"].endswith("safe")
    assert (told["interlock"]["detail"], told["stage"]["status"]) == ("closed", "ok")


def test_every_device_that_is_missing_is_named_with_its_remedy() -> None:
    checks = by_name(list(check_rig(real_rig_without_devices())))
    for view in ("view1", "view2"):
        assert checks[f"network of {view}"].status is Status.OK
        assert checks[f"camera of {view}"].status is Status.FAIL
        assert "is it powered, is its address 127.0.2." in checks[f"camera of {view}"].remedy
    for name, address in (
        ("pulse generator", "/dev/ttyACM-none"),
        ("interlock", "/dev/gpiochip-none"),
        ("stage", "/dev/ttyUSB-none"),
    ):
        assert checks[name].status is Status.FAIL
        assert address in checks[name].detail
        assert checks[name].remedy


def test_a_camera_that_another_program_holds_is_told_and_hides_no_other() -> None:
    config = two_views()
    with wire_rig(config) as wired:
        held = AravisDevice("view1", config.views["view1"].camera.ip)
        try:
            checks = [check_camera(camera, config.views[view].camera.ip) for view, camera in wired.rig.cameras.items()]
        finally:
            held.close()
    assert [check.status for check in checks] == [Status.FAIL, Status.OK]
    assert "another program" in checks[0].remedy


def test_an_open_door_is_a_warning() -> None:
    door = MemoryInterlock("interlock")
    assert check_interlock(door).status is Status.WARN
    door.close_door()
    assert check_interlock(door).status is Status.OK


def test_an_address_that_no_interface_leads_to_fails() -> None:
    if len(Path("/proc/net/route").read_text().splitlines()) > 1:
        pytest.skip("this machine is on a network, which leads everywhere")
    check = check_network("network of view1", "192.168.10.11", 1500)
    assert check.status is Status.FAIL
    assert "192.168.10.11" in check.detail


@pytest.mark.parametrize(
    ("packet_bytes", "status"), [(9000, Status.OK), (1500, Status.WARN), (70000, Status.FAIL)], ids=str
)
def test_packets_must_pass_the_interface(packet_bytes: int, status: Status) -> None:
    """The loopback interface carries packets of 65536 bytes."""
    check = check_network("network of view1", "127.0.0.31", packet_bytes)
    assert check.status is status
    assert ("packet_bytes = " in check.remedy) == (status is not Status.OK)
