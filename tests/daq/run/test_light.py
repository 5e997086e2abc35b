"""The light is off when the generator itself says so, and not before."""

import threading

import pytest

from daq.devices import GeneratorState
from daq.errors import DeviceError, DeviceTimeout, DeviceUnavailable, InterlockOpen
from daq.run import light
from daq.run_plan import PulsePair, RunPlan
from daq.timing import plan_shot_timing
from tests.support.memory_rig import TIMING, MemoryRig

PLAN = RunPlan(name="light", shots=1, pulse=PulsePair(current_a={"view1": 20.0, "view2": 12.0}))


@pytest.fixture(params=[GeneratorState.ARMED, GeneratorState.LIT])
def memory(request: pytest.FixtureRequest) -> MemoryRig:
    """A rig that can give light, or gives it."""
    memory = MemoryRig()
    if request.param is GeneratorState.LIT:
        memory.generator.light({"view1": 0.1}, 60.0)
    else:
        memory.generator.configure(plan_shot_timing(PLAN, dict.fromkeys(memory.cameras, TIMING)))
        memory.generator.arm(1)
    assert memory.generator.state is request.param
    return memory


def test_light_that_goes_off_late_is_confirmed(memory: MemoryRig) -> None:
    memory.generator.stuck = True
    repaired = threading.Timer(0.1, setattr, (memory.generator, "stuck", False))
    repaired.start()
    assert light.confirm_off(memory.rig, 10.0) is None
    assert memory.generator.state is GeneratorState.SAFE
    assert memory.journal.count("off") > 1
    repaired.join()


def test_a_generator_that_can_still_give_light_is_named(memory: MemoryRig) -> None:
    memory.generator.stuck = True
    reason = f"generator: still {memory.generator.state} after off"
    assert light.confirm_off(memory.rig, 0.0) == reason
    with pytest.raises(DeviceError, match=reason):
        light.acknowledge_faults(memory.rig)


def test_a_generator_that_does_not_answer_is_not_known_to_be_off(
    memory: MemoryRig, monkeypatch: pytest.MonkeyPatch
) -> None:
    def silent() -> None:
        raise DeviceTimeout("generator", "off", 1.0)

    monkeypatch.setattr(memory.generator, "off", silent)
    light.try_to_switch_off(memory.rig)
    assert light.confirm_off(memory.rig, 0.0) == "generator: no answer to 'off' within 1 s"
    with pytest.raises(DeviceTimeout):
        light.switch_off(memory.rig)


def test_nobody_waits_for_the_answer_of_a_port_that_has_hung_up(
    memory: MemoryRig, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []

    def gone() -> None:
        asked.append("off")
        raise DeviceUnavailable("generator", "its port has hung up")

    monkeypatch.setattr(memory.generator, "off", gone)
    assert light.confirm_off(memory.rig, 0.2) == "generator: its port has hung up"
    assert asked == ["off"]


def test_an_interlock_that_is_still_open_is_the_reason_why_nothing_can_be_acknowledged(memory: MemoryRig) -> None:
    memory.open_door()
    with pytest.raises(InterlockOpen, match="door: the interlock is open; close it, then acknowledge"):
        light.acknowledge_faults(memory.rig)
    memory.close_door()
    light.acknowledge_faults(memory.rig)
    assert memory.generator.state is GeneratorState.SAFE
