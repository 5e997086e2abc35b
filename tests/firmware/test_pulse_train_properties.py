"""Random trains through the core, over the wire: legal ones come back quantised, others with the right error."""

from collections.abc import Iterator
from dataclasses import astuple, fields

import pytest
import serial
from hypothesis import given, settings
from hypothesis import strategies as st

from daq.drivers.pulse_protocol import Command, ErrorNumber, Reply, Request, decode_reply, encode_request
from daq.simulation.pico.firmware_process import FirmwareProcess
from tests.support.train_oracle import LIMIT, TICK_NS
from tests.support.train_oracle import OracleChannel as Channel


@st.composite
def legal_channels(draw: st.DrawFn) -> Channel:
    a_width_ns, b_width_ns = draw(st.integers(200, 2000)), draw(st.integers(200, 2000))
    camera_ns = draw(st.integers(0, 1_700_000))
    a_start_ns = draw(st.integers(camera_ns, 1_700_000))
    b_start_ns = a_start_ns + draw(st.integers(a_width_ns + LIMIT["MIN_DARK_NS"] + TICK_NS, 199_990))
    a_close_ns = draw(st.integers(a_start_ns + a_width_ns + 2 * TICK_NS, b_start_ns - 2 * TICK_NS))
    b_open_ns = draw(st.integers(a_close_ns, b_start_ns - 2 * TICK_NS))
    return Channel(
        camera_ns=camera_ns,
        a_start_ns=a_start_ns,
        a_width_ns=a_width_ns,
        b_start_ns=b_start_ns,
        b_width_ns=b_width_ns,
        current_ma=draw(st.integers(0, LIMIT["MAX_CURRENT_MA"])),
        frame_a_close_ns=a_close_ns - camera_ns,
        frame_b_open_ns=b_open_ns - camera_ns,
    )


NAMES = [field.name for field in fields(Channel)]
FAR = st.one_of(
    st.builds(int.__add__, st.sampled_from([*LIMIT.values(), 2**31, 2**32 - 3]), st.integers(-2, 2)),
    st.integers(0, 2**32 - 1),
)


@st.composite
def spoilt_channels(draw: st.DrawFn) -> Channel:
    """A legal channel with one or two fields moved a little, to a limit, or anywhere within 32 bits."""
    values = dict(zip(NAMES, astuple(draw(legal_channels())), strict=True))
    for name in draw(st.lists(st.sampled_from(NAMES), min_size=1, max_size=2)):
        moved = draw(FAR) if draw(st.booleans()) else values[name] + draw(st.integers(-500, 500))
        values[name] = min(max(0, moved), 2**32 - 1)
    return Channel(**values)


class Wire:
    """Sends requests as they are; the driver would check and repeat."""

    def __init__(self, port: serial.Serial) -> None:
        self._port = port
        self._sequence = 0

    def ask(self, command: Command, *fields: int) -> Reply:
        self._sequence = self._sequence % 65_535 + 1
        self._port.write(encode_request(Request(self._sequence, command, fields)))
        return decode_reply(self._port.read_until(b"\n"))


@pytest.fixture(scope="module")
def wire() -> Iterator[Wire]:
    with FirmwareProcess({}, lambda _: None) as firmware, serial.Serial(firmware.port, timeout=5.0) as port:
        yield Wire(port)


@settings(max_examples=200)
@given(channel=legal_channels(), number=st.integers(0, 3))
def test_a_legal_train_comes_back_quantised(wire: Wire, channel: Channel, number: int) -> None:
    assert channel.error() is None
    wire.ask(Command.NEW)
    reply = wire.ask(Command.CHANNEL, number, *astuple(channel))
    assert reply.error is None
    actual = channel.quantised()
    assert {name: int(value) for name, value in reply.fields.items()} == {
        "channel": number,
        **{name: getattr(actual, name) for name in NAMES if not name.startswith("frame")},
    }
    loaded = wire.ask(Command.LOAD)
    assert loaded.number("length_ns") == actual.length_ns
    assert loaded.number("period_us") == actual.period_us(LIMIT["MAX_DUTY_PPM"])


@settings(max_examples=400)
@given(channel=spoilt_channels())
def test_any_other_train_is_refused_with_the_right_number(wire: Wire, channel: Channel) -> None:
    expected = channel.error() or channel.quantised().error()
    wire.ask(Command.NEW)
    assert wire.ask(Command.CHANNEL, 0, *astuple(channel)).error == expected
    assert wire.ask(Command.LOAD).error == (None if expected is None else ErrorNumber.NO_TRAIN)


@settings(max_examples=50)
@given(number=st.integers(4, 2**32 - 1), channel=legal_channels())
def test_there_are_four_channels(wire: Wire, number: int, channel: Channel) -> None:
    assert wire.ask(Command.CHANNEL, number, *astuple(channel)).error is ErrorNumber.CHANNEL
