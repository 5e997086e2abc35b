"""The stage driver against a faulty instrument, and the bytes of its protocol."""

import os
import tty
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from daq.drivers.serial_stage import SerialStage, StageScale
from daq.drivers.zaber_protocol import (
    Command,
    MessageError,
    Reply,
    checksum,
    encode_command,
    encode_reply,
    parse_command,
    parse_reply,
)
from daq.errors import DeviceRefused, DeviceTimeout, DeviceUnavailable, ProtocolError
from daq.simulation.stage import SETTINGS, SimulatedStage

texts = st.text(st.characters(min_codepoint=33, max_codepoint=126), max_size=12)


@pytest.fixture
def instrument() -> Iterator[SimulatedStage]:
    with SimulatedStage(speed_mm_s=1000) as simulated:
        yield simulated


def driver(instrument: SimulatedStage, reply_limit_s: float = 0.5, move_limit_s: float = 5.0) -> SerialStage:
    return SerialStage(
        "stage", instrument.port, (0.0, 50.0), reply_limit_s=reply_limit_s, move_limit_s=move_limit_s, poll_s=0.002
    )


def test_checksum_of_the_manual_s_example() -> None:
    assert checksum("01 tools echo") == 0x8F


def test_a_command_without_text_asks_for_the_status() -> None:
    assert encode_command(Command(1, 1, 7, "")) == b"/01 1 07:C7\n"


@given(st.integers(0, 99), st.integers(0, 9), st.integers(0, 99), texts)
def test_commands_survive_the_line(device: int, axis: int, message_id: int, text: str) -> None:
    command = Command(device, axis, message_id, text)
    assert parse_command(encode_command(command)) == command


@given(st.integers(0, 99), st.booleans(), st.booleans(), st.sampled_from(["--", "WR", "FS"]), texts)
def test_replies_survive_the_line(message_id: int, accepted: bool, moving: bool, warning: str, data: str) -> None:
    reply = Reply(1, 1, message_id, accepted, moving, warning, data)
    assert parse_reply(encode_reply(reply)) == reply


@given(st.data())
def test_one_damaged_byte_never_passes(data: st.DataObject) -> None:
    line = bytearray(encode_reply(Reply(1, 1, 7, True, False, "--", "12345")).rstrip())
    position = data.draw(st.integers(0, len(line) - 1))
    line[position] = data.draw(st.integers(0, 255).filter(lambda byte: byte != line[position]))
    with pytest.raises(MessageError):
        parse_reply(bytes(line))


@given(st.floats(-20, 20))
def test_counts_and_heights_are_inverse(z_mm: float) -> None:
    scale = StageScale(zero_mm=25.0)
    assert scale.z_mm(scale.counts(z_mm)) == pytest.approx(z_mm, abs=0.5 * scale.microstep_um / 1000 + 1e-12)


def test_homes_before_the_first_move(instrument: SimulatedStage) -> None:
    with driver(instrument) as stage:
        assert stage.position_mm() == pytest.approx(15.0, abs=1e-4)
        assert stage.move_to(10.0) == pytest.approx(instrument.position_mm, abs=1e-4)


def test_a_stalled_carriage_is_a_fault_by_name(instrument: SimulatedStage) -> None:
    with driver(instrument) as stage:
        stage.move_to(10.0)
        instrument.stall()
        with pytest.raises(DeviceRefused, match=r"stage: 'move abs \d+' stopped with fault FS"):
            stage.move_to(20.0)
        instrument.stall(False)
        assert stage.move_to(20.0) == pytest.approx(20.0, abs=0.0025)


def test_a_movement_that_does_not_end_is_stopped() -> None:
    with SimulatedStage(speed_mm_s=10) as slow, driver(slow, move_limit_s=0.05) as stage:
        with pytest.raises(DeviceTimeout, match=r"no answer to 'home' within 0\.05 s"):
            stage.move_to(20.0)
        assert slow.position_mm == pytest.approx(14.5, abs=0.5)


def test_two_damaged_replies_are_asked_again(instrument: SimulatedStage) -> None:
    with driver(instrument) as stage:
        instrument.garble(2)
        assert stage.position_mm() == pytest.approx(15.0, abs=1e-4)


def test_a_noisy_line_is_an_error_that_shows_the_bytes(instrument: SimulatedStage) -> None:
    with driver(instrument) as stage:
        instrument.garble(100)
        with pytest.raises(ProtocolError, match=r"stage: 'get pos': b'@01 \?"):
            stage.position_mm()


def test_a_pulled_cable_is_an_error_that_names_the_port(instrument: SimulatedStage) -> None:
    with driver(instrument) as stage:
        port = instrument.port
        instrument.unplug()
        with pytest.raises(DeviceUnavailable, match=f"{port} has hung up, as with its cable out"):
            stage.position_mm()


def test_a_missing_port_is_named() -> None:
    with (
        pytest.raises(DeviceUnavailable, match="stage: port /dev/tty-none"),
        SerialStage("stage", "/dev/tty-none", (0, 1)),
    ):
        pass


def test_a_second_client_is_refused(instrument: SimulatedStage) -> None:
    with driver(instrument), pytest.raises(DeviceUnavailable), driver(instrument):
        pass


def test_a_silent_port_is_a_timeout() -> None:
    master, slave = os.openpty()
    tty.setraw(slave)
    try:
        stage = SerialStage("stage", os.ttyname(slave), (0, 1), reply_limit_s=0.02)
        with pytest.raises(DeviceTimeout, match=r"'set comm.checksum 1' within 0\.06 s"), stage:
            pass
    finally:
        os.close(master)
        os.close(slave)


def test_a_stage_that_is_plugged_in_again_is_opened_again(instrument: SimulatedStage) -> None:
    with driver(instrument) as stage:
        stage.move_to(10.0)
        instrument.unplug()
        with pytest.raises(DeviceUnavailable):
            stage.position_mm()
        with pytest.raises(DeviceUnavailable, match=instrument.port):
            stage.recover()
        instrument.plug_in()
        stage.recover()
        assert stage.position_mm() == pytest.approx(10.0, abs=0.0025)
        stage.recover()
        assert stage.move_to(20.0) == pytest.approx(20.0, abs=0.0025)


def test_another_stage_in_its_place_is_refused(instrument: SimulatedStage, monkeypatch: pytest.MonkeyPatch) -> None:
    with driver(instrument) as stage:
        instrument.unplug()
        with pytest.raises(DeviceUnavailable):
            stage.position_mm()
        monkeypatch.setitem(SETTINGS, "system.serial", "100043")
        instrument.plug_in()
        for _ in range(2):
            with pytest.raises(DeviceRefused, match="another stage is plugged in, 100043 instead of 100042"):
                stage.recover()
        with pytest.raises(DeviceUnavailable):
            stage.position_mm()


def test_a_stage_that_is_closed_is_not_opened_again(instrument: SimulatedStage) -> None:
    with driver(instrument) as stage:
        pass
    stage.recover()
    with pytest.raises(DeviceUnavailable, match="is not open"):
        stage.position_mm()
