"""Test of a pulse generator with its light: somebody acts and looks at an oscilloscope, the generator is asked.

It fires what a shot of the rig fires, at its nominal currents. Whatever goes wrong, the generator is off at the end.
"""

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import Protocol

from daq.devices import GeneratorState, GeneratorStatus, PulseGenerator, TriggerSource
from daq.drivers.pulse_probe import ProbeFailure, ProbeImpossible, expect
from daq.drivers.pulse_protocol import HEARTBEAT_MS
from daq.drivers.pulse_self_test import Check, checked
from daq.errors import DeviceError, DeviceRefused
from daq.timing import ShotTiming

WAIT_S = 60.0
"""For somebody to act."""
PERIOD_US = 100_000
ASK_S, CLEAR_S = 0.05, 1.0
SILENCE_S = HEARTBEAT_MS / 1000 + 0.3
ACTS: Mapping[str, tuple[str, str, str]] = {
    "door or key": ("interlock", "open a door, or turn the key", "close it"),
    "emergency stop": ("estop", "press the emergency stop", "release it"),
    "set-point converter": ("setpoint", "unplug the set-point converter", "plug it in"),
}
"""What is to be done while light is fired: the fault that must follow, the words for it, and for its end."""


class Operator(Protocol):
    """Somebody at the rig."""

    def ready(self, task: str) -> bool:
        """Tell a task, and wait until it is done; False if it cannot be done here."""

    def confirms(self, question: str) -> bool:
        """Ask for what can only be seen."""


def light_test(generator: PulseGenerator, timing: ShotTiming, operator: Operator) -> Iterator[Check]:
    """Try everything that needs light.

    Parameters
    ----------
    generator : PulseGenerator
        Open, safe, with nothing latched.
    timing : ShotTiming
        A shot of the rig.
    operator : Operator
        Who acts and looks.

    Yields
    ------
    Check
        As soon as it is known.
    """
    checks: dict[str, Callable[[], str]] = {
        f"pulses of {view}": partial(_pulses, generator, timing, operator, view) for view in timing.views
    }
    checks |= {name: partial(_act, generator, timing, operator, name) for name in ACTS}
    checks["silent host"] = partial(_silence, generator, timing, operator)
    try:
        for name, check in checks.items():
            yield checked(name, check)
            generator.off()
    finally:
        generator.off()


def _await(operator: Operator, task: str) -> None:
    if not operator.ready(task):
        raise ProbeImpossible("left out by the operator")


def _pulses(generator: PulseGenerator, timing: ShotTiming, operator: Operator, view: str) -> str:
    alone = {
        name: replace(each, current_a=each.current_a if name == view else 0.0) for name, each in timing.views.items()
    }
    generator.configure(replace(timing, views=alone))
    _await(operator, f"photodiode and shunt of {view} on the oscilloscope; one shot follows")
    time.sleep(PERIOD_US / 1e6)  # the light before is paid for
    generator.arm(1)
    lit = [pulse for pulse in generator.fire().pulses[view] if pulse.current_a]
    expect(len(lit) == 2, f"{len(lit)} pulses were fired, not 2")
    first, second = lit
    told = (
        f"pulses of {first.width_ns} and {second.width_ns} ns, {second.start_ns - first.start_ns} ns apart, "
        f"{first.current_a:g} A"
    )
    expect(operator.confirms(f"{told}: within 10 ns and 5 %, and every other LED dark?"), f"{told}: not seen so")
    return told


def _act(generator: PulseGenerator, timing: ShotTiming, operator: Operator, name: str) -> str:
    fault, act, undo = ACTS[name]
    generator.configure(timing)
    _await(operator, f"ten shots a second follow, for {WAIT_S:g} s: {act} meanwhile")
    _arm(generator, WAIT_S)
    status = _while_armed(generator)
    expect(status.state is GeneratorState.FAULT, f"nothing was noticed within {WAIT_S:g} s")
    expect(fault in status.faults, f"fault {', '.join(status.faults)}, not {fault}")
    expect(operator.confirms("dark?"), f"fault {fault}, but there was light after it")
    expect(generator.status().counters["fired"] == status.counters["fired"], "shots were fired after the fault")
    _expect_refusal(generator)
    _await(operator, undo)
    _clear(generator)
    return f"fault {fault}, dark, ARM refused"


def _silence(generator: PulseGenerator, timing: ShotTiming, operator: Operator) -> str:
    generator.configure(timing)
    _await(operator, "ten shots a second follow, and this program says nothing more: they must end after three seconds")
    _arm(generator, 2 * SILENCE_S)
    time.sleep(SILENCE_S)
    faults = generator.status().faults
    expect("heartbeat" in faults, f"faults after {SILENCE_S:g} s of silence: {', '.join(faults) or 'none'}")
    expect(
        operator.confirms("did the light end after three seconds?"), "there was light in spite of the fault heartbeat"
    )
    generator.clear()
    return f"fault heartbeat within {SILENCE_S:g} s, dark"


def _arm(generator: PulseGenerator, time_s: float) -> None:
    generator.arm(round(time_s * 1e6 / PERIOD_US), TriggerSource.TIMER, PERIOD_US)


def _while_armed(generator: PulseGenerator) -> GeneratorStatus:
    """The first status that is not ARMED; asking is the heartbeat."""
    while (status := generator.status()).state is GeneratorState.ARMED:
        time.sleep(ASK_S)
    return status


def _clear(generator: PulseGenerator) -> None:
    """A converter that has come back is asked again ten times a second."""
    end_s = time.monotonic() + CLEAR_S
    while True:
        try:
            return generator.clear()
        except DeviceRefused:
            if time.monotonic() > end_s:
                raise
        time.sleep(ASK_S)


def _expect_refusal(generator: PulseGenerator) -> None:
    try:
        generator.arm(1)
    except DeviceError:
        return
    raise ProbeFailure("ARM was not refused")
