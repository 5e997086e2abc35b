"""The witness blames who asks on after a fault has been seen, and nobody who does not know of it yet."""

from daq.errors import DeviceError, DeviceRefused
from tests.support.watched_rig import Call, Darkness, Witness

REFUSED = DeviceRefused("generator", "fault: interlock")


def call(thread: str, device: str, verb: str, began_ended_s: tuple[float, float], answer: object = None) -> Call:
    return Call(thread, device, verb, *began_ended_s, answer)


def asked_before(*calls: Call) -> tuple[str, ...]:
    witness = Witness()
    witness.calls = sorted(calls, key=lambda one: one.ended_s)
    darkness = witness.darkness
    assert darkness is not None
    return darkness.asked_before


FIRE = call("acquisition", "generator", "fire", (0.0, 1.0), REFUSED)
OPEN = call("run-guard", "interlock", "is_closed", (1.1, 1.2), False)
OFF = call("run-guard", "generator", "off", (1.3, 1.5))


def test_a_guard_that_was_not_told_yet_may_look_at_the_interlock() -> None:
    assert asked_before(FIRE, OPEN, OFF) == ()


def test_who_has_seen_it_asks_nothing_before_the_light_is_off() -> None:
    look = call("acquisition", "interlock", "is_closed", (1.05, 1.1), False)
    assert asked_before(FIRE, look, OPEN, OFF) == ("interlock: is_closed",)
    status = call("run-guard", "generator", "status", (1.25, 1.28))
    assert asked_before(FIRE, OPEN, status, OFF) == ("generator: status",)


def test_threads_that_ask_cameras_know_what_the_run_knows() -> None:
    frames = call("frames-view1", "view1", "collect", (1.1, 1.2))
    assert asked_before(FIRE, frames, OPEN, OFF) == ("view1: collect",)


def test_calls_while_the_light_goes_off_or_after_it_are_no_fault() -> None:
    twice = call("acquisition", "generator", "off", (1.05, 2.0))
    reason = call("acquisition", "interlock", "is_closed", (2.0, 2.1), False)
    assert asked_before(FIRE, twice, OPEN, OFF, reason) == ()


def test_a_pulse_after_a_fault_and_a_question_before_the_light_is_off_are_found() -> None:
    witness = Witness()

    def call(verb: str, began_s: float, answer: object, thread: str = "acquisition") -> None:
        witness.calls.append(Call(thread, "device", verb, began_s, began_s + 0.25, answer))

    call("status", 1.0, DeviceError("device", "fault"), thread="lamp generator_0")
    assert witness.darkness is None
    call("collect", 2.0, DeviceError("device", "gone"), thread="frames-view1")
    call("ask", 2.5, None, thread="a question-view1")
    witness.pulses_s += [1.0, 2.75, 4.5]
    call("off", 3.0, DeviceError("device", "no answer"))
    call("off", 3.5, None)
    call("arm", 4.0, None)
    assert witness.darkness == Darkness(0.5, 1.5, ("device: ask", "device: off"))
