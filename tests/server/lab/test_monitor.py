import asyncio
import threading
from functools import partial
from pathlib import Path

import pytest

from daq.devices import DeviceIdentity, GeneratorStatus
from daq.errors import DeviceTimeout
from server.lab.duty import Duty, Health, Lamp
from server.lab.events import EventPublisher
from server.lab.monitor import STALE_S, RigMonitor
from tests.support.memory_rig import MemoryRig
from tests.support.serving import DEADLINE_S, serving


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
    assert lamps["view2"] == Lamp(name="view2", kind="camera", health=Health.FAULT, detail="view2: does not answer")
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


def test_an_old_answer_is_not_green_and_not_shown(tmp_path: Path) -> None:
    memory, now_s = MemoryRig(), [100.0]
    memory.open_door()
    monitor = RigMonitor(memory.rig, tmp_path, now_s=lambda: now_s[0])
    asyncio.run(monitor.ask())
    now_s[0] += STALE_S
    lamps = {lamp.name: lamp for lamp in monitor.lamps}
    assert (lamps["view1"].health, lamps["interlock"].health) == (Health.WARN, Health.FAULT)
    assert (lamps["view1"].detail, lamps["view1"].age_s) == ("no answer for 2 s", STALE_S)
    asyncio.run(monitor.ask())
    lamp = {lamp.name: lamp for lamp in monitor.lamps}["view1"]
    assert (lamp.health, lamp.age_s) == (Health.OK, 0.0)


def test_a_red_lamp_tells_when_the_last_answer_came_and_not_what_it_was(tmp_path: Path) -> None:
    memory, now_s = MemoryRig(), [100.0]
    monitor = RigMonitor(memory.rig, tmp_path, now_s=lambda: now_s[0])
    asyncio.run(monitor.ask())
    memory.cameras["view1"].is_lost = True
    now_s[0] += 7
    asyncio.run(monitor.ask())
    lamp = {lamp.name: lamp for lamp in monitor.lamps}["view1"]
    assert (lamp.health, lamp.detail) == (Health.FAULT, "view1: does not answer; last answer 7 s ago")
    assert lamp.age_s == 7


def test_one_slow_device_makes_no_other_lamp_old(tmp_path: Path) -> None:
    memory, hangs, answered = MemoryRig(), threading.Event(), threading.Semaphore(0)
    memory.cameras["view1"].ask = lambda: assert_set(hangs)  # type: ignore[method-assign]
    memory.cameras["view2"].ask = answered.release  # type: ignore[method-assign]
    monitor = RigMonitor(memory.rig, tmp_path)

    async def watch() -> None:
        task = asyncio.create_task(monitor.run(Duty("lamps", EventPublisher())))
        for _ in range(3):
            assert await asyncio.to_thread(answered.acquire, timeout=10.0), "the lamps wait for each other"
        hangs.set()
        task.cancel()

    asyncio.run(watch())


def assert_set(hangs: threading.Event) -> None:
    assert hangs.wait(30.0)


@pytest.mark.parametrize("resting", [True, False])
def test_what_was_lost_is_opened_again_between_runs_only(tmp_path: Path, resting: bool) -> None:
    memory, recovered = MemoryRig(), list[str]()
    for device in (*memory.cameras.values(), memory.generator, memory.stage):
        device.recover = partial(recovered.append, device.name)  # type: ignore[method-assign]
    asyncio.run(RigMonitor(memory.rig, tmp_path, lambda: resting).ask())
    assert sorted(recovered) == (["generator", "stage", "view1", "view2"] if resting else [])


def test_a_camera_that_comes_back_says_who_it_is(tmp_path: Path) -> None:
    memory = MemoryRig()
    monitor = RigMonitor(memory.rig, tmp_path)
    asyncio.run(monitor.ask())
    camera = memory.cameras["view1"]
    camera.is_lost = True
    asyncio.run(monitor.ask())
    camera.is_lost = False
    camera.identity = lambda: DeviceIdentity("other", "camera", "7", "1")  # type: ignore[method-assign]
    asyncio.run(monitor.ask())
    assert {lamp.name: lamp for lamp in monitor.lamps}["view1"].detail == "other camera, 7"


def test_an_error_that_no_driver_knows_is_a_red_lamp_and_hides_no_other(tmp_path: Path) -> None:
    memory = MemoryRig()
    memory.generator.status = lambda: 1 / 0  # type: ignore[assignment, method-assign, return-value]
    lamps = lamps_of(memory, tmp_path / "gone")
    assert lamps["pulse generator"].detail == "ZeroDivisionError: division by zero"
    assert (lamps["disk"].health, lamps["view1"].health) == (Health.FAULT, Health.OK)


def test_however_often_a_slow_device_is_asked_for_no_other_lamp_gets_old(tmp_path: Path) -> None:
    memory, answers = MemoryRig(), threading.Event()
    memory.cameras["view1"].ask = partial(answers.wait, 20)  # type: ignore[assignment, method-assign]
    monitor = RigMonitor(memory.rig, tmp_path)

    async def ask() -> None:
        impatient = [asyncio.create_task(monitor.reconnect("view1")) for _ in range(20)]
        await asyncio.sleep(0.1)
        try:
            await asyncio.wait_for(monitor.reconnect("interlock"), 15)
        finally:
            answers.set()
            await asyncio.gather(*impatient)

    asyncio.run(ask())
    assert {lamp.name: lamp.health for lamp in monitor.lamps}["interlock"] is Health.OK


def test_the_threads_of_lamps_end_with_their_server(tmp_path: Path) -> None:
    before = set(threading.enumerate())
    with serving(tmp_path):
        lamps = [one for one in set(threading.enumerate()) - before if one.name.startswith("lamp ")]
        assert lamps
    for lamp in lamps:
        lamp.join(DEADLINE_S)
    assert not [lamp.name for lamp in lamps if lamp.is_alive()]
