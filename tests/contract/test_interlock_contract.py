"""What every Interlock does, run on the real libgpiod with a simulated chip, and on the chain in memory."""

import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass

import pytest

from daq.devices import Interlock
from daq.drivers.gpio_interlock import GpioInterlock
from daq.simulation.gpio_chip import CHIP_PATH, ChipUnsupported, SimulatedSwitchLine
from daq.simulation.interlock import DoorSwitch, MemoryInterlock


@dataclass(frozen=True)
class Door:
    """An opened interlock and the switch that moves it."""

    interlock: Interlock
    switch: DoorSwitch


def gpio(active_low: bool) -> tuple[Interlock, DoorSwitch]:
    try:
        switch = SimulatedSwitchLine(5, active_low=active_low)
    except ChipUnsupported as error:
        pytest.skip(str(error))
    return GpioInterlock("interlock", CHIP_PATH, 5, active_low=active_low), switch


@pytest.fixture(params=["gpio to supply", "gpio to ground", "memory"])
def door(request: pytest.FixtureRequest) -> Iterator[Door]:
    with ExitStack() as stack:
        if request.param == "memory":
            memory = MemoryInterlock("interlock")
            yield Door(stack.enter_context(memory), memory)
        else:
            interlock, switch = gpio(request.param == "gpio to ground")
            yield Door(stack.enter_context(interlock), switch)


def test_names_itself(door: Door) -> None:
    assert door.interlock.name == "interlock"
    identity = door.interlock.identity()
    assert all((identity.vendor, identity.model, identity.serial, identity.firmware))


def test_is_open_until_somebody_closes_the_door(door: Door) -> None:
    assert not door.interlock.is_closed()
    door.switch.close_door()
    assert door.interlock.is_closed()
    door.switch.open_door()
    assert not door.interlock.is_closed()


def test_a_broken_wire_reads_as_open(door: Door) -> None:
    door.switch.close_door()
    door.switch.break_wire()
    assert not door.interlock.is_closed()


def test_waiting_ends_at_the_deadline(door: Door) -> None:
    before_s = time.monotonic()
    assert not door.interlock.wait_for_change(0.05)
    assert 0.04 < time.monotonic() - before_s < 1.0


def test_a_door_that_opens_ends_the_wait(door: Door) -> None:
    door.switch.close_door()
    assert door.interlock.wait_for_change(1.0)
    visitor = threading.Timer(0.05, door.switch.open_door)
    visitor.start()
    before_s = time.monotonic()
    assert door.interlock.wait_for_change(5.0)
    assert time.monotonic() - before_s < 2.0
    visitor.join()


def test_a_door_that_opened_and_closed_between_two_waits_is_noticed(door: Door) -> None:
    door.switch.close_door()
    assert door.interlock.wait_for_change(1.0)
    door.switch.open_door()
    door.switch.close_door()
    assert door.interlock.is_closed()
    assert door.interlock.wait_for_change(0.0)


def test_moving_the_switch_to_where_it_is_changes_nothing(door: Door) -> None:
    door.switch.open_door()
    assert not door.interlock.wait_for_change(0.0)
