"""Self-test of a pulse generator over its line: everything that can be tried without lighting an LED.

Every pulse train of the test has a current of 0 A: the camera triggers of channel 0 work, the light does not.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import partial

from daq.drivers.pulse_framing import ABORT_BYTE, framed
from daq.drivers.pulse_line import PulseLine
from daq.drivers.pulse_probe import DARK, Probe, ProbeFailure, ProbeImpossible, expect, outcome
from daq.drivers.pulse_protocol import (
    CHANNEL_COUNT,
    MAX_SEQUENCE,
    UNCHANGED,
    Command,
    ErrorNumber,
    Fault,
    Reply,
    Source,
    State,
    decode_request,
    encode_request,
)
from daq.errors import DeviceError

MODEL = "tomoshadow-pulse"


class Verdict(StrEnum):
    """Result of one check."""

    OK = "ok"
    FAIL = "fail"
    SKIPPED = "skipped"


@dataclass(frozen=True)
class Check:
    """One check: what was tried, how it went, and what was seen."""

    name: str
    verdict: Verdict
    detail: str


_FORBIDDEN = {
    ErrorNumber.CHANNEL: replace(DARK, channel=CHANNEL_COUNT),
    ErrorNumber.WIDTH: replace(DARK, a_width_ns=100_000),
    ErrorNumber.SEPARATION: replace(DARK, b_start_ns=21_001),
    ErrorNumber.EDGE: replace(DARK, camera_ns=4_000_000_000),
    ErrorNumber.CURRENT: replace(DARK, current_ma=1_000_000),
    ErrorNumber.STRADDLE: replace(DARK, frame_a_close_ns=20_500),
}


def self_test(line: PulseLine, identity: Reply) -> Iterator[Check]:
    """Try everything that needs no light; the generator is off at the end.

    Parameters
    ----------
    line : PulseLine
        Opened line.
    identity : Reply
        What opening it answered.

    Yields
    ------
    Check
        As soon as it is known.
    """
    yield checked("identity", partial(_identity, identity))
    for name, check in _CHECKS.items():
        yield checked(name, partial(check, Probe(line)))


def checked(name: str, check: Callable[[], str]) -> Check:
    """Try one thing: what it says, why it could not be tried, or what failed."""
    try:
        return Check(name, Verdict.OK, check())
    except ProbeImpossible as reason:
        return Check(name, Verdict.SKIPPED, str(reason))
    except (ProbeFailure, DeviceError) as error:
        return Check(name, Verdict.FAIL, str(error))


def _identity(identity: Reply) -> str:
    fields = identity.fields
    expect(fields["model"] == MODEL, f"is a {fields['model']}, not a {MODEL}")
    return (
        f"{fields['model']} {fields['version']} ({fields['build']}), serial {fields['serial']}, "
        f"protocol {fields['protocol']}, start {identity.boot}"
    )


def _starts_safe(probe: Probe) -> str:
    status = probe.done(Command.STATUS)
    faults = Fault(status.number("faults"))
    remedy = "see to its cause, then acknowledge it (tomoshadow firmware clear, or the page)"
    expect(not faults, f"fault latched: {faults.name}; {remedy}")
    expect(status.number("state") == State.SAFE, f"state is {State(status.number('state')).name}")
    return "state SAFE, nothing latched"


def _damaged_lines(probe: Probe) -> str:
    before = probe.done(Command.STATUS).number("crc_errors")
    good = probe.numbered(Command.BEAT)
    damaged = good.replace(b"BEAT", b"BEAU")
    overlong = b"A" * 200 + b"\n"
    for sent, error in ((damaged, ErrorNumber.CRC), (overlong, ErrorNumber.LINE_TOO_LONG)):
        reply = probe.line.exchange(sent)
        expect(reply.error is error, f"{sent[:20]!r} was answered by {outcome(reply)} instead of {error.name}")
    counted = probe.done(Command.STATUS).number("crc_errors") - before
    expect(counted == 2, f"2 damaged lines were sent, {counted} were counted")
    return "refused and counted"


def _nonsense(probe: Probe) -> str:
    number = decode_request(probe.numbered(Command.BEAT)).sequence
    for body, error in (("FLY", ErrorNumber.UNKNOWN_COMMAND), ("ARM many 0 0", ErrorNumber.SYNTAX)):
        number = number % MAX_SEQUENCE + 1
        reply = probe.line.exchange(framed(f">{number} {body}"))
        expect(reply.error is error, f"{body} was answered by {outcome(reply)} instead of {error.name}")
    return "unknown command and missing number refused"


def _repeated_line(probe: Probe) -> str:
    probe.load_dark_train()
    load = probe.numbered(Command.LOAD)
    first, again = probe.line.exchange(load), probe.line.exchange(load)
    expect(first == again, f"the same line got {outcome(first)} and then {outcome(again)}")
    other = probe.line.exchange(encode_request(replace(decode_request(load), command=Command.BEAT)))
    expect(other.error is ErrorNumber.SEQUENCE, f"a used number was answered by {outcome(other)}")
    return "carried out once"


def _limits(probe: Probe) -> str:
    probe.done(Command.NEW)
    for error, channel in _FORBIDDEN.items():
        probe.refused(error, Command.CHANNEL, *channel.fields())
    probe.refused(ErrorNumber.NO_TRAIN, Command.LOAD)
    return f"refused: {', '.join(error.name for error in _FORBIDDEN)}"


def _led_limits(probe: Probe) -> str:
    """Asks alone: a limit that was tightened would stay until the next start."""
    limits = [probe.done(Command.LIMIT, channel, UNCHANGED, UNCHANGED, UNCHANGED) for channel in range(CHANNEL_COUNT)]
    currents_a = [limit.number("max_current_ma") / 1000 for limit in limits]
    for channel, current_a in enumerate(currents_a):
        above = replace(DARK, channel=channel, current_ma=round(current_a * 1000) + 1)
        reply = probe.line.answer(Command.CHANNEL, *above.fields())
        refused = reply.error in (ErrorNumber.LIMIT, ErrorNumber.CURRENT)
        expect(refused, f"channel {channel}: 1 mA above {current_a:g} A was answered by {outcome(reply)}")
    return f"refused above {', '.join(f'{current_a:g}' for current_a in currents_a)} A"


def _quantisation(probe: Probe) -> str:
    asked = replace(DARK, camera_ns=1003, a_start_ns=20_005, b_start_ns=26_411, b_width_ns=1005)
    reply = probe.done(Command.CHANNEL, *asked.fields())
    tick_ns = probe.done(Command.ID).number("tick_ns")
    for name in ("camera_ns", "a_start_ns", "a_width_ns", "b_start_ns", "b_width_ns"):
        actual_ns, asked_ns = reply.number(name), getattr(asked, name)
        expect(actual_ns % tick_ns == 0 and 2 * abs(actual_ns - asked_ns) <= tick_ns, f"{name} {asked_ns}: {actual_ns}")
    return f"edges at the nearest {tick_ns} ns, told truly"


def _no_shot_unarmed(probe: Probe) -> str:
    probe.load_dark_train()
    probe.refused(ErrorNumber.NOT_ARMED, Command.FIRE)
    return "FIRE refused"


def _budget(probe: Probe) -> str:
    probe.require_interlock(closed=True)
    probe.load_dark_train()
    before = probe.done(Command.STATUS)
    probe.refused(ErrorNumber.SHOTS, Command.ARM, 0, Source.COMMAND, 0)
    probe.done(Command.ARM, 2, Source.COMMAND, 0)
    early = probe.fire_when_allowed() + probe.fire_when_allowed()
    probe.refused(ErrorNumber.NOT_ARMED, Command.FIRE)
    after = probe.done(Command.STATUS)
    for name, expected in (("fired", 2), ("early", early), ("suppressed", early + 1), ("requested", early + 3)):
        counted = after.number(name) - before.number(name)
        expect(counted == expected, f"{name} counted {counted} instead of {expected}")
    return f"2 of 2 shots without light, {early} early ones ignored, the third refused, all counted"


def _off(probe: Probe) -> str:
    probe.require_interlock(closed=True)
    probe.load_dark_train()
    probe.done(Command.ARM, 5, Source.COMMAND, 0)
    probe.done(Command.OFF)
    probe.refused(ErrorNumber.NOT_ARMED, Command.FIRE)
    probe.done(Command.ARM, 5, Source.COMMAND, 0)
    beat = probe.numbered(Command.BEAT)
    reply = probe.line.exchange(beat[:3] + ABORT_BYTE + beat[3:])
    expect(reply.error is None and reply.number("state") == State.SAFE, f"the abort byte left {outcome(reply)}")
    return "OFF and the abort byte, inside a line, disarm"


def _open_interlock(probe: Probe) -> str:
    probe.require_interlock(closed=False)
    probe.load_dark_train()
    probe.refused(ErrorNumber.INTERLOCK_OPEN, Command.ARM, 1, Source.COMMAND, 0)
    return "ARM refused"


def _ends_off(probe: Probe) -> str:
    state = State(probe.line.off().number("state"))
    expect(state is not State.ARMED, f"state is {state.name}")
    return f"state {state.name}"


_CHECKS: dict[str, Callable[[Probe], str]] = {
    "starts safe": _starts_safe,
    "damaged lines": _damaged_lines,
    "nonsense": _nonsense,
    "repeated line": _repeated_line,
    "limits": _limits,
    "limits of the LEDs": _led_limits,
    "quantisation": _quantisation,
    "no shot unarmed": _no_shot_unarmed,
    "open interlock": _open_interlock,
    "budget and period": _budget,
    "off": _off,
    "ends off": _ends_off,
}
