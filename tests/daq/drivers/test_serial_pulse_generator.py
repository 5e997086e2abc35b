"""The driver on a bad line, and against a generator that dies, hangs or is somebody else."""

import binascii
import os
import pty
import signal
import threading
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

import pytest
import serial

from daq.devices import GeneratorState
from daq.drivers import pulse_line
from daq.drivers.pulse_framing import DamagedLine
from daq.drivers.pulse_limits import kept_limits, store_limits
from daq.drivers.pulse_line import PulseLine
from daq.drivers.pulse_protocol import (
    FIELDS,
    MAX_SEQUENCE,
    PROTOCOL_VERSION,
    Command,
    Reply,
    Request,
    Stored,
    decode_reply,
    decode_request,
    encode_reply,
    encode_request,
)
from daq.drivers.serial_pulse_generator import SerialPulseGenerator
from daq.errors import DeviceError, DeviceRefused, DeviceTimeout, DeviceUnavailable, ProtocolError
from daq.run_plan import PulsePair, RunPlan
from daq.simulation.pico.firmware_process import FirmwareProcess
from daq.timing import CameraTiming, ShotTiming, plan_shot_timing

CHANNELS = {"left": 0, "right": 1}
CAMERA = CameraTiming(1_000, 20_000, 500, 30_000_000, 1_000_000)
PERIOD_MS = 10


def shot_timing() -> ShotTiming:
    plan = RunPlan(name="faults", shots=1, pulse=PulsePair(current_a=dict.fromkeys(CHANNELS, 20.0)))
    return plan_shot_timing(plan, dict.fromkeys(CHANNELS, CAMERA))


@pytest.fixture
def firmware() -> Iterator[FirmwareProcess]:
    with FirmwareProcess(CHANNELS, lambda _: None) as process:
        yield process


@pytest.fixture
def generator(firmware: FirmwareProcess) -> Iterator[SerialPulseGenerator]:
    """A generator that is armed; whether it can still be switched off at the end is for the test to say."""
    with suppress(DeviceError), SerialPulseGenerator("generator", firmware.port, CHANNELS) as opened:
        opened.configure(shot_timing())
        opened.arm(100)
        yield opened


@contextmanager
def within(limit_s: float) -> Iterator[None]:
    start_s = time.monotonic()
    yield
    assert time.monotonic() - start_s < limit_s


@pytest.mark.parametrize("lost", [1, 2, 3])
def test_a_lost_reply_does_not_fire_twice(
    firmware: FirmwareProcess, generator: SerialPulseGenerator, lost: int
) -> None:
    firmware.lose_replies(lost)
    assert generator.fire().sequence == 1
    assert generator.status().counters["requested"] == 1


@pytest.mark.parametrize("damaged", [1, 5])
def test_a_damaged_reply_does_not_fire_twice(
    firmware: FirmwareProcess, generator: SerialPulseGenerator, damaged: int
) -> None:
    firmware.damage_replies(damaged)
    assert generator.fire().sequence == 1
    assert generator.status().counters["requested"] == 1


def test_garbage_from_the_line_is_passed_over(firmware: FirmwareProcess, generator: SerialPulseGenerator) -> None:
    firmware.garbage(b"\n".join([bytes(range(32, 256)), b"", b"<? 1 ERR 1*0000", b"<1 1 OK torn"]))
    with within(1.0):
        assert generator.fire().sequence == 1
    assert generator.status().counters["requested"] == 1


def test_a_storm_of_damaged_lines_is_weathered_and_counted(
    firmware: FirmwareProcess, generator: SerialPulseGenerator
) -> None:
    firmware.noise(b"storm\n" * 60 + b"torn")
    with within(1.0):
        assert generator.fire().sequence == 1
    assert generator.status().counters["crc_errors"] >= 60


def test_an_unreadable_line_is_a_protocol_error(firmware: FirmwareProcess, generator: SerialPulseGenerator) -> None:
    firmware.damage_replies(10_000)
    with within(1.5), pytest.raises(ProtocolError, match="only damaged lines"):
        generator.status()


def test_silence_names_device_command_and_limit(firmware: FirmwareProcess, generator: SerialPulseGenerator) -> None:
    os.kill(firmware.pid, signal.SIGSTOP)
    with within(1.5), pytest.raises(DeviceTimeout, match=r"^generator: no answer to 'FIRE' within 1 s$"):
        generator.fire()
    with within(1.5), pytest.raises(DeviceTimeout, match="OFF"):
        generator.off()
    os.kill(firmware.pid, signal.SIGCONT)
    assert generator.status().state is GeneratorState.SAFE
    assert generator.status().counters["fired"] <= 1


def test_off_does_not_wait_for_a_command_without_answer() -> None:
    lit = threading.Event()
    outcome: list[str] = []
    with (
        FirmwareProcess(CHANNELS, lambda _: lit.set()) as firmware,
        SerialPulseGenerator("generator", firmware.port, CHANNELS) as generator,
    ):

        def fire() -> None:
            try:
                generator.fire()
            except DeviceError as error:
                outcome.append(error.reason)

        generator.configure(shot_timing())
        generator.arm(100)
        firmware.lose_replies(3)
        thread = threading.Thread(target=fire)
        thread.start()
        assert lit.wait(5.0)
        with within(0.9):  # the replies that are still to be lost cost 0.2 s each
            generator.off()
        thread.join(5.0)
        assert outcome == ["FIRE was overtaken by off"]
        assert generator.status().state is GeneratorState.SAFE


def test_an_off_that_another_one_made_the_board_forget_is_sent_again_at_once(
    firmware: FirmwareProcess, generator: SerialPulseGenerator, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The abort byte of the other one clears what the board has received and not read yet."""
    asked, ended = threading.Event(), list[str]()

    def encode(request: Request) -> bytes:
        asked.set()
        return encode_request(request)

    def off() -> None:
        generator.off()
        ended.append("off")

    monkeypatch.setattr(pulse_line, "_REPEAT_S", 60.0)
    monkeypatch.setattr(pulse_line, "encode_request", encode)
    firmware.lose_replies(1)
    first = threading.Thread(target=off)
    first.start()
    assert asked.wait(5.0)
    generator.off()
    first.join(5.0)
    assert ended == ["off"]


def test_a_killed_generator_is_unavailable(firmware: FirmwareProcess, generator: SerialPulseGenerator) -> None:
    firmware.kill()
    for ask in (generator.fire, generator.status, generator.off):
        with within(1.0), pytest.raises(DeviceUnavailable, match="generator"):
            ask()


def test_a_generator_killed_in_mid_command_is_unavailable(
    firmware: FirmwareProcess, generator: SerialPulseGenerator
) -> None:
    os.kill(firmware.pid, signal.SIGSTOP)
    killer = threading.Timer(0.2, firmware.kill)
    killer.start()
    with within(0.9), pytest.raises(DeviceUnavailable):
        generator.fire()
    killer.join()


def test_a_reset_is_an_error_and_leaves_no_light(firmware: FirmwareProcess, generator: SerialPulseGenerator) -> None:
    generator.fire()
    firmware.reset()
    with pytest.raises(DeviceError, match="was reset"):
        generator.fire()
    status = generator.status()
    assert (status.state, status.faults, status.counters["fired"]) == (GeneratorState.FAULT, ("restarted",), 0)
    with pytest.raises(DeviceRefused, match="clear it first: restarted"):
        generator.arm(1)
    generator.clear()
    with pytest.raises(DeviceRefused, match="no pulse train"):
        generator.arm(1)
    generator.configure(shot_timing())
    generator.arm(1)
    assert generator.fire().sequence == 1


def test_a_train_that_was_lost_before_arming_is_not_armed_whoever_found_the_reset(
    firmware: FirmwareProcess, generator: SerialPulseGenerator
) -> None:
    generator.off()
    generator.configure(shot_timing())
    firmware.reset()
    with pytest.raises(DeviceError, match="was reset"):  # as its lamp may be told
        generator.status()
    with pytest.raises(DeviceRefused, match="no pulse train"):
        generator.arm(1)
    assert generator.status().state is GeneratorState.SAFE


def test_a_watchdog_reset_is_a_fault(firmware: FirmwareProcess, generator: SerialPulseGenerator) -> None:
    firmware.reset(by_watchdog=True)
    with pytest.raises(DeviceError, match="was reset"):
        generator.status()
    assert generator.status().faults == ("watchdog", "restarted")


def send(firmware: FirmwareProcess, request: Request) -> Reply:
    with serial.Serial(firmware.port, timeout=5.0) as port:
        port.write(encode_request(request))
        return decode_reply(port.read_until(b"\n"))


def test_numbers_wrap_around(firmware: FirmwareProcess) -> None:
    send(firmware, Request(MAX_SEQUENCE - 2, Command.BEAT))
    with SerialPulseGenerator("generator", firmware.port, CHANNELS) as generator:
        for _ in range(4):
            generator.status()
    # OFF 65534, STATUS 65535 to 3, OFF 4
    assert send(firmware, Request(0, Command.ID)).number("last") == 4


def test_a_new_session_goes_on_counting(firmware: FirmwareProcess) -> None:
    """The generator keeps its newest reply: a session that began with the same number would be answered by it."""
    assert send(firmware, Request(1, Command.BEAT)).error is None
    with SerialPulseGenerator("generator", firmware.port, CHANNELS) as generator:
        assert generator.status().state is GeneratorState.SAFE


def test_the_port_belongs_to_one(firmware: FirmwareProcess, generator: SerialPulseGenerator) -> None:
    with pytest.raises(DeviceUnavailable, match="second"), SerialPulseGenerator("second", firmware.port, CHANNELS):
        pass
    assert generator.status().state is GeneratorState.ARMED


def test_an_absent_port_is_unavailable() -> None:
    with pytest.raises(DeviceUnavailable, match="/dev/absent"), SerialPulseGenerator("generator", "/dev/absent", {}):
        pass


def test_a_closed_generator_is_unavailable() -> None:
    with pytest.raises(DeviceUnavailable, match="not open"):
        SerialPulseGenerator("generator", "/dev/absent", {}).status()


@pytest.mark.parametrize("channels", [{"left": 0, "right": 0}, {"left": 4}, {"left": -1}])
def test_impossible_channels_are_named(channels: dict[str, int]) -> None:
    with pytest.raises(ValueError, match=r"generator: channels .* must be distinct, 0 to 3"):
        SerialPulseGenerator("generator", "/dev/absent", channels)


def test_an_error_in_the_body_is_not_hidden_by_closing(firmware: FirmwareProcess) -> None:
    def lose_generator_and_fail() -> None:
        with SerialPulseGenerator("generator", firmware.port, CHANNELS):
            firmware.kill()
            raise RuntimeError("acquisition")

    with pytest.raises(RuntimeError, match="acquisition") as raised:
        lose_generator_and_fail()
    assert "light not confirmed off" in raised.value.__notes__[0]


@contextmanager
def instrument(answer: Callable[[bytes], bytes]) -> Iterator[str]:
    """Something else on the port, which answers every line in its own way."""
    ours, theirs = pty.openpty()
    tty.setraw(theirs)

    def serve() -> None:
        with os.fdopen(ours, "rb", buffering=0, closefd=False) as lines:
            for line in iter(lines.readline, b"stop\n"):
                os.write(ours, answer(line))

    thread = threading.Thread(target=serve)
    thread.start()
    try:
        yield os.ttyname(theirs)
    finally:
        os.write(theirs, b"\nstop\n")
        thread.join(5.0)
        os.close(ours)
        os.close(theirs)


def test_a_silent_instrument_is_no_generator() -> None:
    with (
        instrument(lambda _: b"") as port,
        within(4.0),
        pytest.raises(DeviceTimeout, match="no answer to 'ID' within 3 s"),
        SerialPulseGenerator("generator", port, CHANNELS),
    ):
        pass


def answering(**fields: str) -> Callable[[bytes], bytes]:
    def answer(line: bytes) -> bytes:
        try:
            request = decode_request(line)
        except DamagedLine:
            return b""
        return encode_reply(Reply(request.sequence, 1, fields=fields))

    return answer


def test_another_protocol_is_named() -> None:
    fields = dict.fromkeys(("model", "version", "build", "serial"), "x")
    numbers = {"protocol": "1", "channels": "4", "tick_ns": "8", "last": "0"}
    with (
        instrument(answering(**fields, **numbers)) as port,
        pytest.raises(ProtocolError, match="speaks protocol 1, this driver speaks 4: flash"),
        SerialPulseGenerator("generator", port, CHANNELS),
    ):
        pass


@pytest.fixture
def soon(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whoever has said nothing right within a second is judged by what he has said."""
    monkeypatch.setattr(pulse_line, "OPENING_LIMIT_S", 1.0)


@pytest.mark.usefixtures("soon")
def test_firmware_of_an_older_protocol_is_named() -> None:
    """To it, no line of this driver has a number: error 4, in its own form."""
    with (
        instrument(lambda _: b"? 1 ERR 4*%04X\n" % binascii.crc_hqx(b"? 1 ERR 4", 0xFFFF)) as port,
        pytest.raises(ProtocolError, match="speaks protocol 2 or older, this driver speaks 4: flash"),
        SerialPulseGenerator("generator", port, CHANNELS),
    ):
        pass


@pytest.mark.usefixtures("soon")
def test_a_line_that_only_echoes_is_named() -> None:
    with (
        instrument(lambda line: line) as port,
        pytest.raises(ProtocolError, match="gives back what is sent, ID among it, and nobody answers"),
        SerialPulseGenerator("generator", port, CHANNELS),
    ):
        pass


def test_a_generator_behind_an_echo_is_heard() -> None:
    """Two wires for both directions: what is sent comes back before the answer."""
    names = (*FIELDS[Command.ID].reply, *FIELDS[Command.STATUS].reply)
    fields = dict.fromkeys(names, "0") | {"protocol": str(PROTOCOL_VERSION), "state": "0"}

    def answer(line: bytes) -> bytes:
        try:
            request = decode_request(line)
        except DamagedLine:
            return line
        told = {name: fields[name] for name in FIELDS[request.command].reply}
        return line + encode_reply(Reply(request.sequence, 1, fields=told))

    with instrument(answer) as port, SerialPulseGenerator("generator", port, CHANNELS) as generator:
        generator.off()
        assert generator.status().state is GeneratorState.SAFE


def test_a_reply_without_its_fields_is_named() -> None:
    with (
        instrument(answering(colour="red")) as port,
        pytest.raises(ProtocolError, match=r"answered ID with fields \['colour'\]"),
        SerialPulseGenerator("generator", port, CHANNELS),
    ):
        pass


def test_the_generator_itself_keeps_the_limit_of_an_led(firmware: FirmwareProcess) -> None:
    with SerialPulseGenerator("generator", firmware.port, CHANNELS, {"right": 19.9}) as limited:
        with pytest.raises(DeviceRefused, match=r"CHANNEL refused: .* limit that was set for this channel"):
            limited.configure(shot_timing())
        firmware.reset()
        with pytest.raises(DeviceError, match="was reset"):
            limited.status()
        with pytest.raises(DeviceRefused, match="limit"):
            limited.configure(shot_timing())
    with (
        SerialPulseGenerator("generator", firmware.port, CHANNELS) as without_limits,
        pytest.raises(DeviceRefused, match="limit"),
    ):
        without_limits.configure(shot_timing())


def test_a_permitted_current_is_not_cut_by_its_own_limit(firmware: FirmwareProcess) -> None:
    with SerialPulseGenerator("generator", firmware.port, CHANNELS, dict.fromkeys(CHANNELS, 20.0)) as limited:
        train = limited.configure(shot_timing())
        assert {pulse.current_a for pulses in train.pulses.values() for pulse in pulses} == {20.0}


@pytest.mark.parametrize("wrong", ["max_current", "max_light"])
def test_a_rig_file_that_permits_more_than_the_board_keeps_is_refused(firmware: FirmwareProcess, wrong: str) -> None:
    line = PulseLine("generator", firmware.port)
    line.open()
    store_limits(line, 4 * [(20_000, 200, 300)])
    line.close()
    limits = {"max_current": {"left": 20.0}, "max_light": {"left": 0.3}}
    with SerialPulseGenerator("generator", firmware.port, CHANNELS, limits["max_current"], limits["max_light"]) as fits:
        assert fits.status().state is GeneratorState.SAFE
    board_a = limits[wrong]["left"]
    limits[wrong] = {"left": board_a + 0.05}
    words = f"the rig file permits {wrong}_a {board_a + 0.05:g} A for left, the board keeps {board_a:g} A for channel 0"
    refused = SerialPulseGenerator("generator", firmware.port, CHANNELS, limits["max_current"], limits["max_light"])
    with pytest.raises(DeviceRefused, match=words), refused:
        pass
    line.open()
    line.close()


def test_limits_that_the_board_keeps_already_cost_no_room(firmware: FirmwareProcess) -> None:
    line = PulseLine("generator", firmware.port)
    line.open()
    for _ in range(70):
        store_limits(line, 4 * [(20_000, 200, 300)])
    for current_ma in range(63):
        store_limits(line, 4 * [(current_ma, 200, 0)])
    kept = kept_limits(line)
    with pytest.raises(DeviceRefused, match=r"64 times.*erase-limits\.uf2"):
        store_limits(line, 4 * [(20_000, 200, 300)])
    assert kept_limits(line) == kept == (Stored.WHOLE, 4 * [(62, 200, 0)])
    with pytest.raises(DeviceRefused, match=r"STORE refused: .* above 30000 mA"):
        store_limits(line, 4 * [(30_001, 200, 300)])
    line.close()
