"""The pulse generator on a serial port: ``daq.devices.PulseGenerator`` in terms of its protocol."""

import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from types import TracebackType
from typing import Self

from daq.devices import DeviceIdentity, GeneratorState, GeneratorStatus, TriggerSource
from daq.drivers.pulse_limits import check_stored_limits, tighten_limits
from daq.drivers.pulse_line import PulseLine
from daq.drivers.pulse_protocol import (
    CHANNEL_COUNT,
    COUNTERS,
    Command,
    Fault,
    Reply,
    Source,
    State,
)
from daq.drivers.pulse_train import LoadedTrain, actual_train, pulses_of, shift_ns
from daq.errors import DeviceError, DeviceRefused, PlanError, ProtocolError
from daq.shot import FiredTrain
from daq.timing import ShotTiming, ViewTiming

MAX_PERIOD_US = 10_000_000
RESTARTED = "restarted"
"""Fault of a generator that started anew while it was armed; the driver latches it, the board knows nothing of it."""


class SerialPulseGenerator:
    """Fires the light and triggers the cameras through the microcontroller.

    Parameters
    ----------
    name : str
        Name in the rig configuration.
    port : str
        Serial port, for example ``/dev/serial/by-id/...``.
    channels : Mapping[str, int]
        Channel of each view, 0 to 3.
    max_current_a, max_light_a : Mapping[str, float]
        Limits of the LED of each view, for its pulses and its continuous light, which the generator itself shall keep;
        views that are not named keep the generator's own.
    clock_s : Callable[[], float]
        The generator's time, in which it has to answer.

    Raises
    ------
    ValueError
        Two views share a channel, or a channel does not exist.
    """

    def __init__(
        self,
        name: str,
        port: str,
        channels: Mapping[str, int],
        max_current_a: Mapping[str, float] | None = None,
        max_light_a: Mapping[str, float] | None = None,
        clock_s: Callable[[], float] = time.monotonic,
    ) -> None:
        numbers = list(channels.values())
        if len(set(numbers)) < len(numbers) or not set(numbers) <= set(range(CHANNEL_COUNT)):
            raise ValueError(f"{name}: channels {dict(channels)} must be distinct, 0 to {CHANNEL_COUNT - 1}")
        self._name = name
        self._channels = dict(channels)
        self._max_current_a = dict(max_current_a or {})
        self._max_light_a = dict(max_light_a or {})
        self._line = PulseLine(name, port, clock_s)
        self._identity: Reply | None = None
        self._is_open = False
        self._loaded: LoadedTrain | None = None
        self._restarts_when_armed: int | None = None

    @property
    def name(self) -> str:
        """Name in the rig configuration."""
        return self._name

    def __enter__(self) -> Self:
        self._identity = self._line.open()
        self._make_safe()
        self._is_open = True
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._is_open = False
        try:
            self.off()
        except DeviceError as not_off:
            if error is None:
                raise
            error.add_note(f"light not confirmed off: {not_off}")
        finally:
            self._line.close()

    def recover(self) -> None:
        """Open the port again if it hung up: light off, limits checked, nothing loaded, nothing armed.

        Raises
        ------
        DeviceUnavailable, DeviceTimeout
            Nothing is plugged in there yet, or it does not answer.
        DeviceRefused
            Another board is, or the board keeps other limits than the rig file.
        """
        if not (self._is_open and self._line.is_lost):
            return
        known, self._loaded = self._opened_identity(), None
        found = self._line.reopen()
        if (serial := found.fields["serial"]) != (expected := known.fields["serial"]):
            self._line.close()
            raise DeviceRefused(
                self._name,
                f"another board is plugged in, {serial} instead of {expected}: plug the right one in, or start the "
                "server again to work with this one",
            )
        self._make_safe()
        self._identity = found

    def _make_safe(self) -> None:
        try:
            self.off()
            check_stored_limits(self._line, self._channels, self._max_current_a, self._max_light_a)
        except DeviceError:
            self._line.close()
            raise

    def identity(self) -> DeviceIdentity:
        """Model, serial number and firmware version, as the generator answered when it was opened."""
        fields = self._opened_identity().fields
        return DeviceIdentity("tomoshadow", fields["model"], fields["serial"], f"{fields['version']} {fields['build']}")

    def configure(self, timing: ShotTiming) -> FiredTrain:
        """Load a pulse train; returns the actual one, sequence 0.

        Raises
        ------
        PlanError
            A view has no channel.
        DeviceRefused
            The generator is armed, or the train breaks one of its limits.
        """
        self._check_views(timing.views)
        self._loaded = None
        shift = shift_ns(timing, self._opened_identity().number("tick_ns"))
        tighten_limits(self._line, self._channels, self._max_current_a, self._max_light_a)
        self._line.ask(Command.NEW)
        replies = {view: self._set_channel(view, edges, shift) for view, edges in timing.views.items()}
        loaded = self._line.ask(Command.LOAD)
        self._loaded = LoadedTrain(loaded.number("train"), loaded.number("period_us"), actual_train(replies))
        return self._loaded.actual

    def arm(self, shots: int, source: TriggerSource = TriggerSource.COMMAND, period_us: int = 0) -> int:
        """Permit this many shots to one source; returns the shortest period of the loaded train, in us.

        Raises
        ------
        PlanError
            The shots are to follow each other faster than the loaded train permits.
        DeviceRefused
            Without a train, while armed, with an open interlock or emergency stop, with a latched fault.
        """
        if self._has_restarted:
            raise DeviceRefused(self._name, f"{Command.ARM} refused: a fault is latched; clear it first: {RESTARTED}")
        if self._loaded is not None and 0 < period_us < self._loaded.period_us:
            raise PlanError(
                f"{self._name}: a shot every {period_us} us is too fast for this pulse train, which its duty limit "
                f"permits every {self._loaded.period_us} us"
            )
        if source is not TriggerSource.TIMER:
            period_us = min(period_us, MAX_PERIOD_US)
        self._done(Command.ARM, shots, Source[source.name], period_us)
        self._restarts_when_armed = self._line.restarts
        return self._loaded.period_us if self._loaded is not None else MAX_PERIOD_US

    def light(self, current_a: Mapping[str, float], time_s: float) -> None:
        """Continuous light of low current, until `off` or the time is over; `status` is the heartbeat that keeps it on.

        Raises
        ------
        PlanError
            A view has no channel.
        DeviceRefused
            A current is above the limit of continuous light; armed; just after pulses; open interlock.
        """
        self._check_views(current_a)
        currents_ma = [0] * CHANNEL_COUNT
        for view, limit in current_a.items():
            currents_ma[self._channels[view]] = round(limit * 1000)
        tighten_limits(self._line, self._channels, self._max_current_a, self._max_light_a)
        self._line.ask(Command.LIGHT, round(time_s * 1000), *currents_ma)

    def fire(self) -> FiredTrain:
        """Fire one shot; its sequence is the generator's count of shots since it was powered up.

        Raises
        ------
        DeviceRefused
            Not armed, too early, interlock open; nothing was fired.
        """
        reply = self._done(Command.FIRE)
        if self._loaded is None or reply.number("train") != self._loaded.number:
            raise ProtocolError(self._name, f"fired train {reply.number('train')}, which this driver did not load")
        return replace(self._loaded.actual, sequence=reply.number("fired"))

    def last_fired(self) -> FiredTrain:
        """Newest shot of any source, as the generator counts and times it in its own ticks.

        Raises
        ------
        DeviceRefused
            A view of this driver had no part in it, or there was none.
        """
        tick_ns = self._opened_identity().number("tick_ns")
        replies = {view: self._line.ask(Command.SHOT, channel) for view, channel in self._channels.items()}
        return FiredTrain(
            sequence=max(reply.number("fired") for reply in replies.values()),
            camera_trigger_ns={view: tick_ns * reply.number("camera_ticks") for view, reply in replies.items()},
            pulses={view: pulses_of(reply, "ticks", tick_ns) for view, reply in replies.items()},
        )

    def status(self) -> GeneratorStatus:
        """State, faults and counters; also the heartbeat that keeps the generator armed."""
        reply = self._line.ask(Command.STATUS)
        faults = tuple(fault.name.lower() for fault in Fault if fault & reply.number("faults") and fault.name)
        state = GeneratorState[State(reply.number("state")).name]
        if self._has_restarted and state is GeneratorState.SAFE:
            state = GeneratorState.FAULT
        return GeneratorStatus(
            state=state,
            faults=(*faults, RESTARTED) if self._has_restarted else faults,
            interlock_closed=reply.number("interlock") == 1,
            shots_left=reply.number("shots_left"),
            counters={name: reply.number(name) for name in COUNTERS},
            estop_closed=reply.number("estop") == 1,
        )

    def off(self) -> None:
        """Light off, disarm; overtakes whatever another thread is asking.

        Raises
        ------
        DeviceError
            The abort byte was sent, but the generator did not confirm within the limit.
        """
        reply = self._line.off()
        state = State(reply.number("state"))
        if state in (State.ARMED, State.LIT):
            raise ProtocolError(self._name, f"is still {state.name.lower()} after off")
        if not self._has_restarted:
            self._restarts_when_armed = None

    def clear(self) -> None:
        """Acknowledge latched faults; refused while its cause lasts."""
        self._line.ask(Command.CLEAR)
        self._restarts_when_armed = None

    @property
    def _has_restarted(self) -> bool:
        return self._restarts_when_armed is not None and self._restarts_when_armed < self._line.restarts

    def _done(self, command: Command, *fields: int) -> Reply:
        """Reply of a command that makes light; a refusal names the faults behind it."""
        try:
            return self._line.ask(command, *fields)
        except DeviceRefused as refused:
            faults = self.status().faults
            if not faults:
                raise
            raise DeviceRefused(self._name, f"{refused.reason}: {', '.join(faults)}") from refused

    def _opened_identity(self) -> Reply:
        if self._identity is None:
            raise DeviceError(self._name, "has not been opened")
        return self._identity

    def _check_views(self, views: Iterable[str]) -> None:
        strangers = sorted(set(views) - set(self._channels))
        if strangers:
            raise PlanError(f"{self._name}: views {strangers} have no channel; there are {sorted(self._channels)}")

    def _set_channel(self, view: str, edges: ViewTiming, shift_ns: int) -> Reply:
        pulse_b = edges.pulse_b
        single = pulse_b.open_ns == pulse_b.close_ns
        return self._line.ask(
            Command.CHANNEL,
            self._channels[view],
            edges.camera_trigger_ns + shift_ns,
            edges.pulse_a.open_ns + shift_ns,
            edges.pulse_a.close_ns - edges.pulse_a.open_ns,
            0 if single else pulse_b.open_ns + shift_ns,
            pulse_b.close_ns - pulse_b.open_ns,
            round(edges.current_a * 1000),
            edges.frame_a.close_ns - edges.camera_trigger_ns,
            edges.frame_b.open_ns - edges.camera_trigger_ns,
        )
