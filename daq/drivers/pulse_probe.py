"""Probe: asks a pulse generator for what it must do or must refuse, with pulse trains that give no light."""

from dataclasses import dataclass

from daq.drivers.pulse_line import LIMIT_S, PulseLine
from daq.drivers.pulse_protocol import MAX_SEQUENCE, Command, ErrorNumber, Reply, Request, encode_request


class ProbeFailure(Exception):
    """The generator did something else than it must."""


class ProbeImpossible(Exception):
    """The generator or what is connected to it is not in the state that a check needs."""


@dataclass(frozen=True)
class DarkChannel:
    """Fields of CHANNEL for a double exposure without light: legal, the paper's widths, 0 A."""

    channel: int = 0
    camera_ns: int = 0
    a_start_ns: int = 20_000
    a_width_ns: int = 1000
    b_start_ns: int = 26_400
    b_width_ns: int = 1000
    current_ma: int = 0
    frame_a_close_ns: int = 22_000
    frame_b_open_ns: int = 23_000

    def fields(self) -> tuple[int, ...]:
        """Fields in the order of the protocol."""
        return tuple(vars(self).values())


DARK = DarkChannel()


def expect(condition: bool, otherwise: str) -> None:
    """Raise ProbeFailure with this text unless the condition holds."""
    if not condition:
        raise ProbeFailure(otherwise)


def outcome(reply: Reply) -> str:
    """OK, or the name of the error."""
    return "OK" if reply.error is None else reply.error.name


@dataclass(frozen=True)
class Probe:
    """Asks over an opened line."""

    line: PulseLine

    def done(self, command: Command, *fields: int) -> Reply:
        """Reply of a command that must be carried out."""
        reply = self.line.answer(command, *fields)
        expect(reply.error is None, f"{command} was answered by {outcome(reply)}")
        return reply

    def refused(self, error: ErrorNumber, command: Command, *fields: int) -> None:
        """Ask for what must be refused with this error."""
        reply = self.line.answer(command, *fields)
        request = " ".join(map(str, (command, *fields)))
        expect(reply.error is error, f"{request} was answered by {outcome(reply)} instead of {error.name}")

    def numbered(self, command: Command) -> bytes:
        """Line of a command under a number that the generator has not just answered."""
        last = self.done(Command.ID).number("last")
        return encode_request(Request(last % MAX_SEQUENCE + 1, command))

    def load_dark_train(self) -> None:
        """Load a train without light."""
        self.done(Command.NEW)
        self.done(Command.CHANNEL, *DARK.fields())
        self.done(Command.LOAD)

    def require_interlock(self, *, closed: bool) -> None:
        """Raise ProbeImpossible if the interlock is in the other state."""
        if (self.done(Command.STATUS).number("interlock") == 1) != closed:
            raise ProbeImpossible(f"the interlock is {'open' if closed else 'closed'}")

    def fire_when_allowed(self) -> int:
        """Fire until the period is over; how many shots were refused because they came early."""
        early = 0
        deadline_s = self.line.now_s + LIMIT_S
        while self.line.now_s < deadline_s:
            reply = self.line.answer(Command.FIRE)
            if reply.error is None:
                return early
            expect(reply.error is ErrorNumber.EARLY, f"FIRE was answered by {outcome(reply)}")
            early += 1
        raise ProbeFailure(f"no shot within {LIMIT_S:g} s, {early} were too early")
