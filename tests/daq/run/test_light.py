"""The light is off when the generator itself says so, and not before."""

import threading

import pytest

from daq.devices import GeneratorState
from daq.errors import DeviceError, DeviceTimeout
from daq.run import light
from tests.support.memory_bench import MemoryBench


@pytest.fixture
def bench() -> MemoryBench:
    bench = MemoryBench()
    bench.generator.state = GeneratorState.ARMED
    return bench


def test_light_that_goes_off_late_is_confirmed(bench: MemoryBench) -> None:
    bench.generator.stuck = True
    repaired = threading.Timer(0.1, setattr, (bench.generator, "stuck", False))
    repaired.start()
    assert light.confirm_off(bench.rig, 10.0) is None
    assert bench.generator.state is GeneratorState.SAFE
    assert bench.journal.count("off") > 1
    repaired.join()


@pytest.mark.parametrize("state", [GeneratorState.ARMED, GeneratorState.LIT])
def test_a_generator_that_can_still_give_light_is_named(bench: MemoryBench, state: GeneratorState) -> None:
    bench.generator.state, bench.generator.stuck = state, True
    assert light.confirm_off(bench.rig, 0.0) == f"generator: still {state} after off"
    with pytest.raises(DeviceError, match=f"generator: still {state} after off"):
        light.acknowledge_faults(bench.rig)


def test_a_generator_that_does_not_answer_is_not_known_to_be_off(
    bench: MemoryBench, monkeypatch: pytest.MonkeyPatch
) -> None:
    def silent() -> None:
        raise DeviceTimeout("generator", "off", 1.0)

    monkeypatch.setattr(bench.generator, "off", silent)
    light.try_to_switch_off(bench.rig)
    assert light.confirm_off(bench.rig, 0.0) == "generator: no answer to 'off' within 1 s"
    with pytest.raises(DeviceTimeout):
        light.switch_off(bench.rig)
