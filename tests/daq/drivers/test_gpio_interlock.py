"""The GPIO driver through the real libgpiod: absent chips, busy lines, many edges."""

import pytest

from daq.drivers.gpio_interlock import GpioInterlock
from daq.errors import DeviceUnavailable
from daq.simulation.gpio_chip import CHIP_PATH, ChipUnsupported, SimulatedSwitchLine, free_line


@pytest.fixture
def switch() -> SimulatedSwitchLine:
    try:
        return SimulatedSwitchLine(5)
    except ChipUnsupported as error:
        pytest.skip(str(error))


def test_a_missing_chip_is_named() -> None:
    with pytest.raises(DeviceUnavailable, match="interlock: line 3 of /dev/gpiochip-none: No such file or directory"):
        GpioInterlock("interlock", "/dev/gpiochip-none", 3).__enter__()


def test_a_file_that_is_no_chip_is_refused() -> None:
    with pytest.raises(DeviceUnavailable, match="line 3 of /dev/null"):
        GpioInterlock("interlock", "/dev/null", 3).__enter__()


def test_a_line_that_another_client_holds_is_named(switch: SimulatedSwitchLine) -> None:
    first, second = (GpioInterlock("interlock", CHIP_PATH, 5) for _ in range(2))
    with first, pytest.raises(DeviceUnavailable, match=f"line 5 of {CHIP_PATH}: Device or resource busy"):
        second.__enter__()
    with second:
        assert not second.is_closed()


def test_a_line_that_the_chip_does_not_have_is_named(switch: SimulatedSwitchLine) -> None:
    with pytest.raises(DeviceUnavailable, match=f"line 12 of {CHIP_PATH}"):
        GpioInterlock("interlock", CHIP_PATH, 12).__enter__()


def test_a_closed_driver_says_so(switch: SimulatedSwitchLine) -> None:
    interlock = GpioInterlock("interlock", CHIP_PATH, 5)
    with interlock:
        switch.close_door()
        assert interlock.is_closed()
    with pytest.raises(DeviceUnavailable, match="is not open"):
        interlock.is_closed()


def test_a_bouncing_switch_neither_blocks_nor_lies(switch: SimulatedSwitchLine) -> None:
    with GpioInterlock("interlock", CHIP_PATH, 5) as interlock:
        for _ in range(500):
            switch.close_door()
            switch.open_door()
        switch.close_door()
        changes = 0
        while interlock.wait_for_change(0.0):
            changes += 1
        assert changes >= 1
        assert interlock.is_closed()


def test_identity_names_chip_and_line(switch: SimulatedSwitchLine) -> None:
    identity = GpioInterlock("interlock", CHIP_PATH, 5).identity()
    assert identity.serial == "gpiochip-simulated line 5"
    assert identity.firmware.startswith("libgpiod 2")


def test_the_simulated_chip_knows_its_free_lines(switch: SimulatedSwitchLine) -> None:
    with GpioInterlock("interlock", CHIP_PATH, free := free_line()):
        assert free_line() != free
    assert free_line() == free


def test_the_simulated_chip_has_eight_lines() -> None:
    try:
        with pytest.raises(ValueError, match="line: 8 is outside 0 to 7"):
            SimulatedSwitchLine(8)
    except ChipUnsupported as error:
        pytest.skip(str(error))
