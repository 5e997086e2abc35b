"""C core, Python codec and the table of firmware/README.md say the same."""

import binascii
import itertools
import re
from pathlib import Path

import pytest

from daq.drivers import pulse_framing, pulse_protocol
from daq.drivers.pulse_framing import DamagedLine
from daq.drivers.pulse_protocol import (
    ERROR_TEXT,
    FIELDS,
    Cause,
    Command,
    ErrorNumber,
    Fault,
    Source,
    State,
    decode_reply,
    decode_request,
    encode_reply,
    encode_request,
)
from daq.drivers.serial_pulse_generator import MAX_PERIOD_US
from daq.run_plan import PulsePair

FIRMWARE = Path(__file__).resolve().parents[2] / "firmware"
README = (FIRMWARE / "README.md").read_text()


def table(heading: str) -> list[list[str]]:
    section = README.split(f"\n## {heading}\n")[1].split("\n## ")[0]
    rows = [line.strip("| ").split(" | ") for line in section.splitlines() if line.startswith("|")]
    return rows[2:]


def c_enum(header: str, name: str) -> dict[str, int]:
    text = (FIRMWARE / "core" / header).read_text()
    body = re.search(rf"enum {name} \{{(.*?)\}};", text, re.DOTALL)
    assert body, f"enum {name} is not in {header}"
    return {key: int(value) for key, value in re.findall(r"(\w+) = (\d+)", body[1])}


def without(prefix: str, values: dict[str, int]) -> dict[str, int]:
    return {name.removeprefix(prefix): value for name, value in values.items()}


def named_numbers(heading: str) -> dict[str, int]:
    return {name: int(number) for number, name, *_ in table(heading)}


def test_errors_agree() -> None:
    in_c = without("ERROR_", c_enum("error.h", "error"))
    assert in_c.pop("NONE") == 0
    assert in_c == named_numbers("Errors") == {error.name: error.value for error in ErrorNumber}
    assert {name: text for _, name, text in table("Errors")} == {e.name: text for e, text in ERROR_TEXT.items()}


def test_states_and_faults_agree() -> None:
    in_c = without("STATE_", c_enum("generator_state.h", "state"))
    assert in_c == named_numbers("States") == {state.name: state.value for state in State}
    in_c = without("FAULT_", c_enum("generator_state.h", "fault"))
    assert in_c == named_numbers("Faults") == {str(fault.name): fault.value for fault in Fault}


def test_sources_and_causes_agree() -> None:
    in_c = without("SOURCE_", c_enum("generator_state.h", "source"))
    assert in_c == named_numbers("Sources") == {source.name: source.value for source in Source}
    in_c = without("CAUSE_", c_enum("generator_state.h", "cause"))
    assert in_c == named_numbers("Causes") == {cause.name: cause.value for cause in Cause}


def test_limits_agree() -> None:
    in_c = c_enum("limits.h", "limits")
    assert in_c == {name: int(value) for name, value, _ in table("Limits")}
    assert in_c["CHANNEL_COUNT"] == pulse_protocol.CHANNEL_COUNT
    assert in_c["HEARTBEAT_MS"] == pulse_protocol.HEARTBEAT_MS
    assert in_c["MAX_DUTY_PPM"] == pulse_protocol.MAX_DUTY_PPM
    assert in_c["MAX_PERIOD_US"] == MAX_PERIOD_US


def test_error_texts_state_the_limits() -> None:
    limits = c_enum("limits.h", "limits")
    for error, names in {
        ErrorNumber.LINE_TOO_LONG: ["MAX_LINE"],
        ErrorNumber.WIDTH: ["MIN_WIDTH_NS", "MAX_WIDTH_NS"],
        ErrorNumber.SEPARATION: ["MIN_DARK_NS", "MAX_SEPARATION_NS"],
        ErrorNumber.EDGE: ["MAX_EDGE_NS"],
        ErrorNumber.CURRENT: ["MAX_CURRENT_MA"],
        ErrorNumber.SHOTS: ["MAX_SHOTS"],
        ErrorNumber.LIGHT: ["MAX_LIGHT_MA", "MAX_LIGHT_MS"],
        ErrorNumber.PERIOD: ["MAX_PERIOD_US"],
        ErrorNumber.STORE: ["MAX_CURRENT_MA", "MAX_DUTY_PPM", "MAX_LIGHT_MA"],
    }.items():
        assert [int(number) for number in re.findall(r"\d{3,}", ERROR_TEXT[error])] == [limits[name] for name in names]


def test_every_pulse_that_a_run_plan_allows_is_within_the_limits() -> None:
    limits = c_enum("limits.h", "limits")
    schema = PulsePair.model_json_schema()["properties"]
    assert schema["width_ns"]["minimum"] >= limits["MIN_WIDTH_NS"]
    assert schema["width_ns"]["maximum"] <= limits["MAX_WIDTH_NS"]
    assert schema["separation_ns"]["maximum"] <= limits["MAX_SEPARATION_NS"]
    assert schema["current_a"]["additionalProperties"]["maximum"] * 1000 <= limits["MAX_CURRENT_MA"]


def test_commands_agree() -> None:
    in_table = {
        command: tuple(tuple(text.replace("-", "").split()) for text in (request, reply))
        for command, request, reply, *_ in table("Commands")
    }
    assert in_table == {command.value: (fields.request, fields.reply) for command, fields in FIELDS.items()}
    in_c = re.findall(r'\{"([A-Z]+)", (\d+), ', (FIRMWARE / "core" / "commands.c").read_text())
    in_python = {(command.value, str(len(FIELDS[command].request))) for command in Command if command != Command.ID}
    assert set(in_c) == in_python


def test_protocol_version_and_line_constants_agree() -> None:
    commands = (FIRMWARE / "core" / "commands.h").read_text()
    protocol = (FIRMWARE / "core" / "protocol.h").read_text()
    port = (FIRMWARE / "core" / "port.h").read_text()
    assert f"PROTOCOL_VERSION = {pulse_protocol.PROTOCOL_VERSION}," in commands
    assert f"ABORT_BYTE = 0x{pulse_framing.ABORT_BYTE.hex()}" in port
    assert f"MAX_SEQUENCE = {pulse_protocol.MAX_SEQUENCE}" in protocol


def test_example_lines_have_the_right_crc() -> None:
    examples = re.findall(r"([<>]\d+ (?:ARM|1 OK|1 ERR) ?[^*\n]*)\*([0-9A-F]{4})$", README, re.MULTILINE)
    assert len(examples) == 3
    assert [f"{binascii.crc_hqx(body.encode(), 0xFFFF):04X}" for body, _ in examples] == [crc for _, crc in examples]


VECTORS = (FIRMWARE / "tests" / "golden_vectors.txt").read_text().splitlines()
EXCHANGES = [
    (request[2:], reply[2:])
    for request, reply in itertools.pairwise(VECTORS)
    if request.startswith(">") and reply.startswith("<")
]


UNREADABLE = {ErrorNumber.CRC, ErrorNumber.LINE_TOO_LONG, ErrorNumber.UNKNOWN_COMMAND, ErrorNumber.SYNTAX}


@pytest.mark.parametrize(("request_line", "reply_line"), EXCHANGES)
def test_codec_reads_and_writes_the_golden_vectors(request_line: str, reply_line: str) -> None:
    reply = decode_reply(f"{reply_line}\n".encode())
    assert encode_reply(reply) == f"{reply_line}\n".encode()
    if reply.error in UNREADABLE:
        with pytest.raises(DamagedLine):
            decode_request(f"{request_line}\n".encode())
        return
    request = decode_request(f"{request_line}\n".encode())
    assert encode_request(request) == f"{request_line}\n".encode()
    if reply.error is None:
        assert tuple(reply.fields) == FIELDS[request.command].reply


def test_golden_vectors_cover_commands_and_errors() -> None:
    replies = [decode_reply(f"{reply}\n".encode()) for _, reply in EXCHANGES]
    reached = {reply.error for reply in replies if reply.error}
    assert reached == set(ErrorNumber)
    assert {word for request, _ in EXCHANGES for word in re.findall("[A-Z]+", request)} >= set(Command)
