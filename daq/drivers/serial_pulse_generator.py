"""The pulse generator on a serial port: ``daq.devices.PulseGenerator`` in terms of its protocol.

``ShotTiming`` counts from the start of pulse A, so camera triggers can be negative; the generator counts from
the trigger of the shot, where nothing can be. All edges are shifted by the same whole number of ticks.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import TracebackType
from typing import Self

from daq.devices import DeviceIdentity, GeneratorState, GeneratorStatus
from daq.drivers.pulse_line import PulseLine
from daq.drivers.pulse_protocol import CHANNEL_COUNT, COUNTERS, UNCHANGED, Command, Fault, Reply, Source, State
from daq.errors import DeviceError, PlanError, ProtocolError
from daq.shot import FiredTrain, LightPulse
from daq.timing import ShotTiming, ViewTiming


@dataclass(frozen=True)
class _LoadedTrain:
    """The train that the generator holds: its number there, and its actual edges."""

    number: int
    actual: FiredTrain


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
    max_current_a : Mapping[str, float]
        Limit of the LED of each view, which the generator itself shall keep; views that are not named keep the
        generator's own.

    Raises
    ------
    ValueError
        Two views share a channel, or a channel does not exist.
    """

    def __init__(
        self, name: str, port: str, channels: Mapping[str, int], max_current_a: Mapping[str, float] | None = None
    ) -> None:
        numbers = list(channels.values())
        if len(set(numbers)) < len(numbers) or not set(numbers) <= set(range(CHANNEL_COUNT)):
            raise ValueError(f"{name}: channels {dict(channels)} must be distinct, 0 to {CHANNEL_COUNT - 1}")
        self._name = name
        self._channels = dict(channels)
        self._max_current_a = dict(max_current_a or {})
        self._line = PulseLine(name, port)
        self._identity: Reply | None = None
        self._loaded: _LoadedTrain | None = None

    @property
    def name(self) -> str:
        """Name in the rig configuration."""
        return self._name

    def __enter__(self) -> Self:
        self._identity = self._line.open()
        try:
            self.off()
        except DeviceError:
            self._line.close()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self.off()
        except DeviceError as not_off:
            if error is None:
                raise
            error.add_note(f"light not confirmed off: {not_off}")
        finally:
            self._line.close()

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
        strangers = sorted(set(timing.views) - set(self._channels))
        if strangers:
            raise PlanError(f"{self._name}: views {strangers} have no channel; there are {sorted(self._channels)}")
        self._loaded = None
        shift_ns = _shift_ns(timing, self._opened_identity().number("tick_ns"))
        self._tighten_limits()
        self._line.ask(Command.NEW)
        replies = {view: self._set_channel(view, edges, shift_ns) for view, edges in timing.views.items()}
        number = self._line.ask(Command.LOAD).number("train")
        self._loaded = _LoadedTrain(number, _actual_train(replies))
        return self._loaded.actual

    def arm(self, shots: int) -> None:
        """Permit this many shots; refused without a train, while armed, or with an open interlock."""
        self._line.ask(Command.ARM, shots, Source.COMMAND, 0)

    def fire(self) -> FiredTrain:
        """Fire one shot; its sequence is the generator's count of shots since it was powered up.

        Raises
        ------
        DeviceRefused
            Not armed, too early, interlock open; nothing was fired.
        """
        reply = self._line.ask(Command.FIRE)
        if self._loaded is None or reply.number("train") != self._loaded.number:
            raise ProtocolError(self._name, f"fired train {reply.number('train')}, which this driver did not load")
        return replace(self._loaded.actual, sequence=reply.number("fired"))

    def status(self) -> GeneratorStatus:
        """State, faults and counters; also the heartbeat that keeps the generator armed."""
        reply = self._line.ask(Command.STATUS)
        return GeneratorStatus(
            state=GeneratorState[State(reply.number("state")).name],
            faults=tuple(fault.name.lower() for fault in Fault if fault & reply.number("faults") and fault.name),
            interlock_closed=reply.number("interlock") == 1,
            shots_left=reply.number("shots_left"),
            counters={name: reply.number(name) for name in COUNTERS},
        )

    def off(self) -> None:
        """Light off, disarm; overtakes whatever another thread is asking.

        Raises
        ------
        DeviceError
            The abort byte was sent, but the generator did not confirm within the limit.
        """
        reply = self._line.off()
        if State(reply.number("state")) is State.ARMED:
            raise ProtocolError(self._name, "is still armed after off")

    def clear(self) -> None:
        """Acknowledge latched faults; refused while the interlock is open."""
        self._line.ask(Command.CLEAR)

    def _opened_identity(self) -> Reply:
        if self._identity is None:
            raise DeviceError(self._name, "has not been opened")
        return self._identity

    def _tighten_limits(self) -> None:
        """Before every train: a generator that was reset has forgotten its limits, and every train with them."""
        for view, limit_a in self._max_current_a.items():
            limit_ma = round(limit_a * 1000)
            reply = self._line.ask(Command.LIMIT, self._channels[view], limit_ma, UNCHANGED, UNCHANGED)
            if reply.number("max_current_ma") > limit_ma:
                raise ProtocolError(self._name, f"keeps {reply.number('max_current_ma')} mA as the limit of {view}")

    def _set_channel(self, view: str, edges: ViewTiming, shift_ns: int) -> Reply:
        return self._line.ask(
            Command.CHANNEL,
            self._channels[view],
            edges.camera_trigger_ns + shift_ns,
            edges.pulse_a.open_ns + shift_ns,
            edges.pulse_a.close_ns - edges.pulse_a.open_ns,
            edges.pulse_b.open_ns + shift_ns,
            edges.pulse_b.close_ns - edges.pulse_b.open_ns,
            round(edges.current_a * 1000),
            edges.frame_a.close_ns - edges.camera_trigger_ns,
            edges.frame_b.open_ns - edges.camera_trigger_ns,
        )


def _shift_ns(timing: ShotTiming, tick_ns: int) -> int:
    """Start of pulse A after the trigger of the shot: whole ticks, so that it is quantised without error."""
    earliest_ns = min(min(view.camera_trigger_ns, view.pulse_a.open_ns) for view in timing.views.values())
    return -(min(0, earliest_ns) // tick_ns) * tick_ns


def _actual_train(replies: Mapping[str, Reply]) -> FiredTrain:
    return FiredTrain(
        sequence=0,
        camera_trigger_ns={view: reply.number("camera_ns") for view, reply in replies.items()},
        pulses={view: _actual_pulses(reply) for view, reply in replies.items()},
    )


def _actual_pulses(reply: Reply) -> tuple[LightPulse, ...]:
    current_a = reply.number("current_ma") / 1000
    if not current_a:
        return ()
    return tuple(
        LightPulse(reply.number(f"{pulse}_start_ns"), reply.number(f"{pulse}_width_ns"), current_a) for pulse in "ab"
    )
