"""The devices of a rig, with a witness: what was asked of them, when a fault first showed, and when it was dark."""

import threading
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

from daq.devices import Camera, GeneratorState, GeneratorStatus, Interlock, PulseGenerator, Rig
from daq.errors import DaqError, DeviceOvertaken
from daq.shot import DoubleFrame, FiredTrain


@dataclass(frozen=True)
class Call:
    """What a device was asked, and what came of it.

    Parameters
    ----------
    thread, device, verb : str
        Who asked whom for what.
    began_s, ended_s : float
        On the monotonic clock.
    answer : object
        What it returned, or the error that it raised.
    """

    thread: str
    device: str
    verb: str
    began_s: float
    ended_s: float
    answer: object

    @property
    def shows_fault(self) -> bool:
        """Whoever gets this answer knows that something is wrong."""
        match self.answer:
            case DeviceOvertaken():
                return False
            case DaqError():
                return self.verb not in ("off", "clear", "recover")
            case GeneratorStatus() as status:
                return status.state is GeneratorState.FAULT or not (status.interlock_closed and status.estop_closed)
            case DoubleFrame() as frames:
                return frames.silent
        return self.verb == "is_closed" and self.answer is False

    @property
    def confirms_off(self) -> bool:
        """The generator has said itself that it is disarmed and dark: `off` raises otherwise."""
        return self.verb == "off" and self.answer is None


class Witness:
    """Sees every call of the devices, and every pulse."""

    def __init__(self) -> None:
        self.calls: list[Call] = []
        self.pulses_s: list[float] = []

    def watch(self, rig: Rig) -> Rig:
        """The same rig, watched."""
        return replace(
            rig,
            cameras={view: cast(Camera, _Watched(camera, self)) for view, camera in rig.cameras.items()},
            generator=cast(PulseGenerator, _Watched(rig.generator, self)),
            interlock=cast(Interlock, _Watched(rig.interlock, self)),
        )

    def see_pulse(self, _: FiredTrain) -> None:
        """A shot was fired; a witness of the laboratory."""
        self.pulses_s.append(time.monotonic())

    def forget(self) -> None:
        """Begin anew."""
        self.calls, self.pulses_s = [], []

    @property
    def of_the_run(self) -> Sequence[Call]:
        """Calls of a run or live view, without those of the lamps and of who acknowledges, in the order they ended."""
        return [call for call in list(self.calls) if call.thread.startswith((*_WHO_CONTROLS, *_WHO_ASKS))]

    @property
    def darkness(self) -> "Darkness | None":
        """How it became dark after the first sign of a fault; None if there was none."""
        calls = self.of_the_run
        signs = (call.ended_s for call in calls if call.shows_fault)
        too_late = (call.began_s for call in calls if call.verb == "off")  # a run that does not wait any longer
        seen_s = min((*signs, *too_late), default=None)
        if seen_s is None:
            return None
        later = [call for call in calls if call.ended_s > seen_s]
        armed_s = min((call.began_s for call in later if call.verb == "arm"), default=float("inf"))
        pulses_s = [pulse_s for pulse_s in list(self.pulses_s) if seen_s < pulse_s < armed_s]
        off = next((call for call in later if call.confirms_off), None)
        return Darkness(
            max(pulses_s, default=seen_s) - seen_s,
            None if off is None else off.ended_s - seen_s,
            () if off is None else tuple(_first_asked(calls, off)),
        )


_GUARD = "run-guard"
_WHO_CONTROLS = ("acquisition", "live", _GUARD)
_WHO_ASKS = ("frames-", "begin shot-", "a question-", "disarm-")
"""Threads on which the thread of a run or a live view asks cameras."""
_WHO_KNOWS = ((_GUARD,), ("acquisition", "live", *_WHO_ASKS))
"""Who does not know at once what the other one was told."""


def _first_asked(calls: Sequence[Call], off: Call) -> Iterator[str]:
    """What whoever had seen a fault still asked before the light was off."""
    for threads in _WHO_KNOWS:
        theirs = [call for call in calls if call.thread.startswith(threads)]
        seen_s = min((call.ended_s for call in theirs if call.shows_fault), default=float("inf"))
        for call in theirs:
            if seen_s <= call.began_s < off.began_s and not call.confirms_off:
                yield f"{call.device}: {call.verb}"


@dataclass(frozen=True)
class Darkness:
    """After a fault was detected: a device had answered so, or a run had not waited any longer for an answer.

    Parameters
    ----------
    last_pulse_s : float
        Until the last pulse; 0 if there was none.
    confirmed_s : float | None
        Until the generator had said that it is disarmed and dark; None if it never did.
    asked_before : tuple[str, ...]
        What was asked of any device, by a thread that knew of the fault, before the light was switched off.
    """

    last_pulse_s: float
    confirmed_s: float | None
    asked_before: tuple[str, ...]


class _Watched:
    """A device, each call of which is seen."""

    def __init__(self, device: Any, witness: Witness) -> None:
        self._device = device
        self._witness = witness

    def __getattr__(self, name: str) -> Any:
        member = getattr(self._device, name)
        return self._seen(name, member) if callable(member) else member

    def _seen(self, verb: str, call: Callable[..., object]) -> Callable[..., object]:
        def watched(*fields: object, **named: object) -> object:
            began_s = time.monotonic()
            try:
                answer = call(*fields, **named)
            except Exception as error:
                self._add(verb, began_s, error)
                raise
            self._add(verb, began_s, answer)
            return answer

        return watched

    def _add(self, verb: str, began_s: float, answer: object) -> None:
        thread = threading.current_thread().name
        self._witness.calls.append(Call(thread, self._device.name, verb, began_s, time.monotonic(), answer))
