"""Light: whether it is permitted, off, and known to be off. Nothing here waits for a camera."""

import threading
import time
from collections.abc import Iterator
from contextlib import suppress

from daq.devices import GeneratorState, GeneratorStatus, Rig
from daq.errors import DaqError, DeviceError, DeviceRefused, DeviceUnavailable, InterlockOpen
from daq.run.refusals import RefusalCode, coded, raise_first

_RETRY_S = 0.05
_OPEN_STOPS = frozenset({"interlock", "estop"})
_LIGHT_STATES = frozenset({GeneratorState.ARMED, GeneratorState.LIT})


def check_permitted(rig: Rig) -> None:
    """Refuse while the interlock is open or the generator has a fault.

    Raises
    ------
    DeviceRefused
        The pulse generator has a latched fault.
    InterlockOpen
        The light must not be switched on.
    """
    raise_first(obstacles(rig))


def obstacles(rig: Rig) -> Iterator[DaqError]:
    """Whatever forbids light at present, the first reason first; the generator is asked once."""
    try:
        if not rig.interlock.is_closed():
            yield coded(InterlockOpen(f"{rig.interlock.name}: the interlock is open"), RefusalCode.INTERLOCK_OPEN)
    except DeviceError as error:
        yield coded(error, RefusalCode.INTERLOCK_SILENT)
    try:
        status = rig.generator.status()
    except DeviceError as error:
        yield coded(error, RefusalCode.GENERATOR_SILENT)
    else:
        yield from _obstacles_of(rig.generator.name, status)


def _obstacles_of(name: str, status: GeneratorStatus) -> Iterator[DaqError]:
    """An open door is told before the fault that it causes: the generator may know of it first."""
    if not status.interlock_closed:
        reason = f"{name}: the interlock input of the pulse generator is open"
        yield coded(InterlockOpen(reason), RefusalCode.INTERLOCK_OPEN)
    if not status.estop_closed:
        yield coded(InterlockOpen(f"{name}: the emergency stop of the pulse generator is open"), RefusalCode.ESTOP_OPEN)
    if status.state is GeneratorState.FAULT:
        reason = f"fault: {', '.join(status.faults)}; acknowledge it first"
        yield coded(DeviceRefused(name, reason), RefusalCode.GENERATOR_FAULT)


def check_generator(rig: Rig) -> None:
    """DeviceError if the generator does not answer, or has a fault that an open interlock does not explain."""
    own = [fault for fault in rig.generator.status().faults if fault not in _OPEN_STOPS]
    if own:
        raise DeviceError(rig.generator.name, f"fault: {', '.join(own)}")


def check_closed(rig: Rig) -> None:
    """Refuse to go on while the interlock is open; InterlockOpen says so."""
    if not rig.interlock.is_closed():
        raise InterlockOpen(f"{rig.interlock.name}: the interlock is open; close it, then acknowledge")


def switch_off(rig: Rig) -> None:
    """Light off now, from any thread; DeviceError if the generator does not take the command."""
    rig.generator.off()


def try_to_switch_off(rig: Rig) -> None:
    """Light off now, if the generator takes the command; who has to be sure of it confirms it afterwards."""
    with suppress(DeviceError):
        switch_off(rig)


def confirm_off(rig: Rig, deadline_s: float) -> str | None:
    """Switch off until the generator itself says that it is off; returns why that could not be confirmed.

    A port that has hung up carries no answer until it is opened anew: nobody waits for one.
    """
    deadline = time.monotonic() + deadline_s
    pause = threading.Event()
    while reason := _reason_not_off(rig):
        if isinstance(reason, DeviceUnavailable) or time.monotonic() >= deadline:
            return str(reason)
        pause.wait(_RETRY_S)
    return None


def acknowledge_faults(rig: Rig) -> None:
    """Clear the generator's latched faults in the dark.

    Raises
    ------
    InterlockOpen
        It refuses, as the interlock is still open.
    DeviceError
        It refuses, or the light is not off.
    """
    switch_off(rig)
    try:
        rig.generator.clear()
    except DeviceRefused:
        check_closed(rig)
        raise
    _check_off(rig)


def _reason_not_off(rig: Rig) -> DeviceError | None:
    try:
        switch_off(rig)
        _check_off(rig)
    except DeviceError as error:
        return error
    return None


def _check_off(rig: Rig) -> None:
    state = rig.generator.status().state
    if state in _LIGHT_STATES:
        raise DeviceError(rig.generator.name, f"still {state} after off")
