import asyncio
from pathlib import Path

from daq.devices import GeneratorStatus
from daq.errors import DeviceTimeout
from server.lab.duty import Health, Lamp
from server.lab.monitor import STALE_S, RigMonitor
from tests.support.memory_rig import MemoryRig


def lamps_of(memory: MemoryRig, tmp_path: Path) -> dict[str, Lamp]:
    monitor = RigMonitor(memory.rig, tmp_path)
    asyncio.run(monitor.ask())
    return {lamp.name: lamp for lamp in monitor.lamps}


def test_an_open_door_is_a_red_lamp(tmp_path: Path) -> None:
    memory = MemoryRig()
    assert lamps_of(memory, tmp_path)["interlock"].health is Health.OK
    memory.open_door()
    assert lamps_of(memory, tmp_path)["interlock"].health is Health.FAULT


def test_a_camera_that_dies_between_runs_is_a_red_lamp(tmp_path: Path) -> None:
    memory = MemoryRig()
    memory.cameras["view2"].is_lost = True
    lamps = lamps_of(memory, tmp_path)
    assert lamps["view2"] == Lamp(name="view2", kind="camera", health=Health.FAULT, detail="has stopped answering")
    assert lamps["view1"].health is Health.OK


def test_a_silent_device_is_a_red_lamp_and_hides_no_other(tmp_path: Path) -> None:
    memory = MemoryRig()

    def silent() -> GeneratorStatus:
        raise DeviceTimeout("pulse generator", "status", 0.5)

    memory.generator.status = silent  # type: ignore[method-assign]
    lamps = lamps_of(memory, tmp_path)
    assert lamps["pulse generator"].health is Health.FAULT
    assert "0.5 s" in lamps["pulse generator"].detail
    assert lamps["view1"].detail == "tomoshadow memory, view1"
    assert lamps["disk"].detail.endswith("GB free")


def test_an_old_answer_says_how_old_it_is_and_is_not_green(tmp_path: Path) -> None:
    memory, now_s = MemoryRig(), [100.0]
    memory.open_door()
    monitor = RigMonitor(memory.rig, tmp_path, lambda: now_s[0])
    asyncio.run(monitor.ask())
    now_s[0] += STALE_S
    lamps = {lamp.name: lamp for lamp in monitor.lamps}
    assert (lamps["view1"].health, lamps["interlock"].health) == (Health.WARN, Health.FAULT)
    assert lamps["view1"].detail == "no answer for 5 s; before: tomoshadow memory, view1"
    asyncio.run(monitor.ask())
    assert {lamp.name: lamp.health for lamp in monitor.lamps}["view1"] is Health.OK


def test_an_error_that_no_driver_knows_is_a_red_lamp_and_hides_no_other(tmp_path: Path) -> None:
    memory = MemoryRig()
    memory.generator.status = lambda: 1 / 0  # type: ignore[assignment, method-assign, return-value]
    lamps = lamps_of(memory, tmp_path / "gone")
    assert lamps["pulse generator"].detail == "ZeroDivisionError: division by zero"
    assert (lamps["disk"].health, lamps["view1"].health) == (Health.FAULT, Health.OK)
