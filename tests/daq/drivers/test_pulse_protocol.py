"""Bytes <-> values of the pulse generator's protocol."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from daq.drivers.pulse_framing import DamagedLine, is_echo, is_older_reply
from daq.drivers.pulse_protocol import (
    FIELDS,
    MAX_SEQUENCE,
    Command,
    ErrorNumber,
    Reply,
    Request,
    decode_reply,
    decode_request,
    encode_reply,
    encode_request,
)

NUMBERS = st.integers(0, 2**32 - 1)
SEQUENCES = st.integers(0, MAX_SEQUENCE)
WORDS = st.text("abcdefghijklmnopqrstuvwxyz0123456789_.-", min_size=1, max_size=12)


@st.composite
def requests(draw: st.DrawFn) -> Request:
    command = draw(st.sampled_from(Command))
    count = len(FIELDS[command].request)
    return Request(draw(SEQUENCES), command, tuple(draw(st.lists(NUMBERS, min_size=count, max_size=count))))


answers = st.builds(
    Reply, st.none() | SEQUENCES, NUMBERS, st.none(), st.dictionaries(WORDS, WORDS | NUMBERS.map(str), max_size=9)
)
refusals = st.builds(Reply, st.none() | SEQUENCES, NUMBERS, st.sampled_from(ErrorNumber), st.just({}))


@given(requests())
def test_requests_round_trip(request_: Request) -> None:
    line = encode_request(request_)
    assert decode_request(line) == request_
    assert line.endswith(b"\n")
    assert line.count(b"\n") == 1


@given(requests())
def test_every_request_fits_the_generators_line(request_: Request) -> None:
    assert len(encode_request(request_)) - 1 <= 128


@given(answers | refusals)
def test_replies_round_trip(reply: Reply) -> None:
    assert decode_reply(encode_reply(reply)) == reply


@given(answers | refusals, st.data())
def test_a_flipped_bit_is_damage(reply: Reply, data: st.DataObject) -> None:
    line = bytearray(encode_reply(reply))
    position = data.draw(st.integers(0, len(line) - 1))
    line[position] ^= 1 << data.draw(st.integers(0, 7))
    with pytest.raises(DamagedLine):
        decode_reply(bytes(line))


@given(st.binary(max_size=60))
def test_garbage_is_damage(garbage: bytes) -> None:
    with pytest.raises(DamagedLine):
        decode_reply(garbage + b"\n")


@pytest.mark.parametrize(
    "body",
    [
        b"<1",
        b"<1 1",
        b"<1 1 MAYBE",
        b"<x 1 OK",
        b"<1 1 ERR",
        b"<1 1 ERR 99",
        b"<1 1 OK a",
        b"<1 1 OK =2",
        b"1 1 OK",
        b"",
    ],
)
def test_a_good_crc_does_not_save_a_bad_form(body: bytes) -> None:
    framed = encode_request(Request(1, Command.ID))
    assert decode_request(framed) == Request(1, Command.ID)
    with pytest.raises(DamagedLine):
        decode_reply(_framed(body))


def _framed(body: bytes) -> bytes:
    crc = 0xFFFF
    for byte in body:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ 0x1021 if crc & 0x8000 else crc << 1) & 0xFFFF
    return body + b"*%04X\n" % crc


@given(requests(), answers | refusals)
def test_a_request_is_no_reply_and_a_reply_no_request(request_: Request, reply: Reply) -> None:
    """Whatever a line gives back."""
    with pytest.raises(DamagedLine):
        decode_reply(encode_request(request_))
    with pytest.raises(DamagedLine):
        decode_request(encode_reply(reply))
    assert is_echo(encode_request(request_))
    assert not is_echo(encode_reply(reply))


def test_replies_of_older_firmware_are_known() -> None:
    assert is_older_reply(_framed(b"? 1 ERR 4"))
    assert is_older_reply(_framed(b"0 77 OK model=tomoshadow-pulse protocol=2"))
    assert not is_older_reply(b"? 1 ERR 4*0000\n")
    assert not is_older_reply(encode_reply(Reply(None, 1, ErrorNumber.SYNTAX)))


@pytest.mark.parametrize(
    "wrong",
    [
        Request(1, Command.ARM),
        Request(1, Command.OFF, (1,)),
        Request(1, Command.ARM, (-1, 0, 0)),
        Request(1, Command.ARM, (2**32, 0, 0)),
        Request(MAX_SEQUENCE + 1, Command.OFF),
    ],
)
def test_a_request_that_makes_no_sense_is_not_sent(wrong: Request) -> None:
    with pytest.raises(ValueError, match=r"ARM|OFF|sequence"):
        encode_request(wrong)
