"""A generator whose cable was out, that hung, or that somebody else's board has taken the place of."""

import time
from collections.abc import Iterator
from contextlib import suppress

import pytest

from daq.devices import GeneratorState
from daq.drivers.pulse_limits import store_limits
from daq.drivers.pulse_line import PulseLine
from daq.drivers.pulse_protocol import FIELDS, PROTOCOL_VERSION, Command
from daq.drivers.serial_pulse_generator import SerialPulseGenerator
from daq.errors import DeviceError, DeviceRefused, DeviceTimeout, DeviceUnavailable
from daq.shot import FiredTrain
from daq.simulation.pico.firmware_process import FirmwareProcess
from daq.simulation.port_link import PortLink
from tests.daq.drivers.test_serial_pulse_generator import CHANNELS, answering, instrument, shot_timing

FIRED = list[FiredTrain]()


@pytest.fixture
def firmware() -> Iterator[FirmwareProcess]:
    FIRED.clear()
    with FirmwareProcess(CHANNELS, FIRED.append) as process:
        yield process


@pytest.fixture
def generator(firmware: FirmwareProcess) -> Iterator[SerialPulseGenerator]:
    with suppress(DeviceError), SerialPulseGenerator("generator", firmware.port, CHANNELS) as opened:
        yield opened


def test_a_generator_that_is_plugged_in_again_is_opened_again_and_dark(
    firmware: FirmwareProcess, generator: SerialPulseGenerator
) -> None:
    generator.configure(shot_timing())
    generator.arm(100)
    firmware.unplug()
    with pytest.raises(DeviceUnavailable, match=r"generator: .* has hung up, as with its cable out"):
        generator.status()
    with pytest.raises(DeviceUnavailable, match=f"{firmware.port}: .*could not open port"):
        generator.recover()
    firmware.plug_in()
    with pytest.raises(DeviceUnavailable):
        generator.fire()
    generator.recover()
    assert (generator.status().state, generator.status().faults) == (GeneratorState.FAULT, ("restarted",))
    with pytest.raises(DeviceRefused):
        generator.fire()
    assert FIRED == []
    generator.clear()
    assert generator.status().state is GeneratorState.SAFE
    generator.configure(shot_timing())
    generator.arm(1)
    assert generator.fire().sequence == 1


def test_a_generator_that_is_well_is_left_alone(firmware: FirmwareProcess, generator: SerialPulseGenerator) -> None:
    generator.configure(shot_timing())
    generator.arm(1)
    generator.recover()
    assert generator.status().state is GeneratorState.ARMED


def test_its_inputs_are_as_the_laboratory_left_them(firmware: FirmwareProcess, generator: SerialPulseGenerator) -> None:
    firmware.unplug()
    firmware.set_interlock(False)
    with pytest.raises(DeviceUnavailable):
        generator.status()
    firmware.plug_in()
    generator.recover()
    assert not generator.status().interlock_closed


def test_another_board_is_refused_until_the_right_one_is_back(firmware: FirmwareProcess) -> None:
    link = PortLink("pulse_generator")
    link.lead_to(firmware.port)
    fields = dict.fromkeys(FIELDS[Command.ID].reply, "0") | {"serial": "E66", "protocol": str(PROTOCOL_VERSION)}
    other = answering(**fields)
    with instrument(other) as port, SerialPulseGenerator("generator", link.path, CHANNELS) as generator:
        firmware.unplug()
        with pytest.raises(DeviceUnavailable):
            generator.status()
        link.lead_to(port)
        for _ in range(2):
            with pytest.raises(DeviceRefused, match="another board is plugged in, E66 instead of simulated"):
                generator.recover()
        with pytest.raises(DeviceUnavailable, match="is not open"):
            generator.status()
        firmware.plug_in()
        link.lead_to(firmware.port)
        generator.recover()
        assert generator.status().state is GeneratorState.SAFE
    link.remove()


def test_limits_are_checked_as_at_opening(firmware: FirmwareProcess) -> None:
    with SerialPulseGenerator("generator", firmware.port, CHANNELS, {"left": 20.0}) as generator:
        firmware.unplug()
        with pytest.raises(DeviceUnavailable):
            generator.status()
        firmware.plug_in()
        line = PulseLine("generator", firmware.port)
        line.open()
        store_limits(line, [(19_900, 200, 100)] * 4)
        line.close()
        with pytest.raises(DeviceRefused, match=r"permits max_current_a 20 A for left, the board keeps 19\.9 A"):
            generator.recover()
        with pytest.raises(DeviceUnavailable, match="is not open"):
            generator.status()
        firmware.unplug()  # the flash of a simulated board is empty again
        firmware.plug_in()
        generator.recover()


def test_a_generator_that_hung_answers_again(firmware: FirmwareProcess, generator: SerialPulseGenerator) -> None:
    firmware.hang()
    firmware.set_interlock(False)
    with pytest.raises(DeviceTimeout, match="STATUS"):
        generator.status()
    generator.recover()
    firmware.go_on()
    deadline_s = time.monotonic() + 5.0
    while generator.status().interlock_closed:
        assert time.monotonic() < deadline_s


def test_a_closed_generator_is_not_opened_again(firmware: FirmwareProcess) -> None:
    with SerialPulseGenerator("generator", firmware.port, CHANNELS) as generator:
        pass
    generator.recover()
    with pytest.raises(DeviceUnavailable, match="is not open"):
        generator.status()


def test_a_restart_while_armed_is_a_fault_until_it_is_acknowledged(
    firmware: FirmwareProcess, generator: SerialPulseGenerator
) -> None:
    generator.configure(shot_timing())
    generator.arm(100)
    firmware.reset()
    generator.off()  # the first to hear of it, and it must not fail
    for _ in range(2):
        status = generator.status()
        assert (status.state, status.faults) == (GeneratorState.FAULT, ("restarted",))
        generator.off()
    generator.clear()
    assert (generator.status().state, generator.status().faults) == (GeneratorState.SAFE, ())


def test_a_restart_stands_beside_what_came_after_it(firmware: FirmwareProcess, generator: SerialPulseGenerator) -> None:
    generator.configure(shot_timing())
    generator.arm(100)
    firmware.reset(by_watchdog=True)
    with pytest.raises(DeviceError, match="was reset"):
        generator.status()
    assert generator.status().faults == ("watchdog", "restarted")


def test_a_refused_shot_names_the_fault_behind_it(firmware: FirmwareProcess, generator: SerialPulseGenerator) -> None:
    generator.configure(shot_timing())
    generator.arm(100)
    firmware.set_estop(False)
    with pytest.raises(DeviceRefused, match=r"FIRE refused: a fault is latched.*: estop"):
        generator.fire()


def test_a_restart_of_one_that_is_not_armed_is_no_fault(
    firmware: FirmwareProcess, generator: SerialPulseGenerator
) -> None:
    generator.configure(shot_timing())
    generator.arm(100)
    generator.off()
    firmware.reset()
    with pytest.raises(DeviceError, match="was reset"):
        generator.status()
    assert generator.status().faults == ()


def test_a_cable_that_was_out_while_armed_is_a_fault(
    firmware: FirmwareProcess, generator: SerialPulseGenerator
) -> None:
    generator.configure(shot_timing())
    generator.arm(100)
    firmware.unplug()
    with pytest.raises(DeviceUnavailable):
        generator.off()
    firmware.plug_in()
    generator.recover()
    assert generator.status().faults == ("restarted",)
    generator.clear()
    assert generator.status().state is GeneratorState.SAFE
