"""The image with a virtual serial port: a host finds out what it is, opens it, and talks as on the serial line."""

from collections.abc import Callable
from dataclasses import replace

import pytest

from daq.drivers.pulse_framing import ABORT_BYTE
from daq.drivers.pulse_protocol import Command, ErrorNumber, Fault, Reply, Request, State, decode_reply, encode_request
from daq.simulation.pico.firmware_build import ImageKind
from daq.simulation.pico.rp2040_chip import TRIGGER
from daq.simulation.pico.rp2040_emulator import CYCLE_NS, CYCLES_PER_MS
from daq.simulation.pico.usb_host import CONFIGURATION, DEVICE, PACKET, UsbHost
from daq.simulation.pico.usb_setup import Setup
from tests.support.rp2040_board import PAPER, PERIOD_MS, Board

ENUMERATION_MS = 20
REPLY_LIMIT_MS = 5
WATCHDOG_MS = 200
HEARTBEAT_MS = 3000
KEPT_BYTES = 512 + PACKET
FLOOD_MS = 10
FASTEST_PACKET_NS = 1_000_000 // 19
"""Of 64 bytes: 19 of them fit a millisecond of the bus."""
PACKET_NS = 10_000
"""The emulated bus takes so long for any packet."""
ABORT_WITHIN_NS = 1200
"""From its packet. Each byte before it in the same packet adds a third of a microsecond."""
LONG = replace(PAPER, a_width_ns=2000, b_width_ns=2000)
LONG_CHANNEL = (0, 4_294_967_295, 1_999_999, 1999, 1_999_999, 1999, 29_999, 4_294_967_295, 4_294_967_295)
GET_STRING, GET_QUALIFIER = 3 << 8, 6 << 8


class UsbBoard(Board):
    """The same host as on the serial line, at the other end of a virtual port."""

    def __init__(self) -> None:
        super().__init__(ImageKind.USB)
        self.open()

    @property
    def usb(self) -> UsbHost:
        return self.pico.usb

    def open(self) -> None:
        self.pico.run(self.pico.cycle + ENUMERATION_MS * CYCLES_PER_MS, lambda: self.usb.is_open)
        assert self.usb.is_open

    def say(self, line: bytes) -> bytes:
        received = self.usb.received
        received.clear()
        self.usb.send(line)
        limit = self.pico.cycle + REPLY_LIMIT_MS * CYCLES_PER_MS
        assert self.pico.run(limit, lambda: received.endswith(b"\n")), bytes(received)
        return bytes(received)

    def ask_in_bursts(self, command: Command, *fields: int) -> Reply:
        return self.ask(command, *fields)

    def request(self, setup: Setup, data: bytes = b"") -> bytes | None:
        outcome = self.usb.ask(setup, data)
        self.pico.run_ms(2)
        ended, answer = outcome()
        assert ended
        return answer


@pytest.fixture(scope="module")
def shared() -> UsbBoard:
    return UsbBoard()


@pytest.fixture
def board(shared: UsbBoard) -> UsbBoard:
    shared.ask(Command.OFF)
    shared.ask(Command.CLEAR)
    return shared


def entries(descriptor: bytes) -> list[bytes]:
    """The descriptors of which a configuration consists."""
    found: list[bytes] = []
    while descriptor:
        found.append(descriptor[: descriptor[0]])
        descriptor = descriptor[descriptor[0] :]
    return found


def test_it_is_a_serial_port_to_every_operating_system(board: UsbBoard) -> None:
    device = board.usb.descriptors[DEVICE]
    assert (len(device), device[1], device[4], device[7], device[17]) == (18, DEVICE, 2, 64, 1)
    configuration = board.usb.descriptors[CONFIGURATION]
    assert int.from_bytes(configuration[2:4], "little") == len(configuration) == 67
    parts = entries(configuration)
    interfaces = [part for part in parts if part[1] == 4]
    assert [(part[2], part[4], part[5], part[6]) for part in interfaces] == [(0, 1, 2, 2), (1, 2, 10, 0)]
    endpoints = [part for part in parts if part[1] == 5]
    assert [(part[2], part[3], part[4]) for part in endpoints] == [(0x81, 3, 8), (0x02, 2, 64), (0x82, 2, 64)]
    assert [part[2] for part in parts if part[1] == 0x24] == [0, 1, 2, 6]


def test_its_strings_name_the_product_and_the_board(board: UsbBoard) -> None:
    assert board.usb.strings[:2] == ("tomoshadow", "tomoshadow pulse generator")
    assert board.usb.strings[2] == board.ask(Command.ID).fields["serial"]


def test_what_it_does_not_know_it_refuses_and_goes_on(board: UsbBoard) -> None:
    for setup in (
        Setup(0x80, 6, GET_QUALIFIER, length=10),
        Setup(0x80, 6, GET_STRING | 9, length=255),
        Setup(0x00, 9, 2),
        Setup(0x40, 1),
        Setup(0xC0, 1, length=4),
        Setup(0x21, 0x20, length=6),
    ):
        assert board.request(setup) is None, setup
    assert board.request(Setup(0x80, 0, length=2)) == b"\0\0"
    assert board.request(Setup(0x80, 8, length=1)) == b"\1"
    assert board.request(Setup(0x80, 6, CONFIGURATION << 8, length=20)) == board.usb.descriptors[CONFIGURATION][:20]
    assert board.ask(Command.ID).error is None


def test_lines_of_every_length_go_round(board: UsbBoard) -> None:
    """Longer than one packet, exactly one, and many in one."""
    assert board.ask(Command.CHANNEL, *LONG_CHANNEL).error is ErrorNumber.EDGE
    for length in (1, 62, 63, 64, 65, 127, 128, 129, 200):
        reply = decode_reply(board.say(b"x" * (length - 1) + b"\n") if length > 1 else board.say(b"x\n"))
        assert reply.error is (ErrorNumber.CRC if length < 130 else ErrorNumber.LINE_TOO_LONG)
    lines = [encode_request(Request(number, Command.STATUS, ())) for number in (1001, 1002)]
    board.usb.received.clear()
    board.usb.send(b"".join(lines))
    board.pico.run_ms(REPLY_LIMIT_MS)
    replies = bytes(board.usb.received).splitlines(keepends=True)
    assert [decode_reply(reply).sequence for reply in replies] == [1001, 1002]


def test_every_packet_ends_a_transfer(board: UsbBoard) -> None:
    """A host that waits for a short packet would keep a full one to itself."""
    board.usb.longest_packet = 0
    board.usb.read(False)
    for number in (1100, 1101, 1102):
        board.usb.send(encode_request(Request(number, Command.STATUS, ())))
        board.pico.run_ms(REPLY_LIMIT_MS)
    board.usb.read(True)
    board.pico.run_ms(1)
    assert board.usb.longest_packet == PACKET - 1


def test_it_fires_what_it_was_told(board: UsbBoard) -> None:
    board.pico.run_ms(2 * PERIOD_MS)
    board.configure([PAPER] * 4)
    board.arm(1)
    assert board.shoot() == sorted(edge for i in range(4) for edge in PAPER.edges(i))


def test_the_abort_byte_acts_in_the_interrupt(board: UsbBoard) -> None:
    board.configure([LONG] * 4)
    board.arm(5)
    board.pico.run_ms(2 * PERIOD_MS)
    into_pulse_ns = 300
    before_ns = LONG.a_start_ns + into_pulse_ns - PACKET_NS
    board.when(TRIGGER, True, before_ns // CYCLE_NS, lambda: board.usb.send(ABORT_BYTE))
    board.pico.edges.clear()
    assert board.ask(Command.FIRE).error is None
    board.pico.run_ms(1)
    lights = [edge for edge in board.waveform() if edge[1].startswith("light")]
    assert len(lights) == 8, "four pulses A, no pulse B"
    dark_ns = max(at for at, _, high in lights if not high)
    assert dark_ns - LONG.a_start_ns - into_pulse_ns < ABORT_WITHIN_NS
    assert State(board.ask(Command.STATUS).number("state")) is State.SAFE


def gone(board: UsbBoard, how: str) -> None:
    """The program closes the port, or the computer lets go of the bus."""
    if how == "closed":
        assert board.request(Setup(0x21, 0x22)) == b""
    elif how == "suspended":
        board.usb.suspend()
    else:
        board.usb.reset()
        board.pico.run_ms(1)
        board.open()


@pytest.mark.parametrize("how", ["closed", "suspended", "reset"])
def test_a_host_that_has_gone_from_the_bus_trips_at_once(board: UsbBoard, how: str) -> None:
    gone(board, how)
    assert State(board.ask(Command.STATUS).number("state")) is State.SAFE, "nothing was armed"
    board.configure([PAPER] * 4)
    board.arm(5)
    armed_at = board.pico.cycle
    gone(board, how)
    board.pico.run_ms(1)
    status = board.ask(Command.STATUS)
    assert (State(status.number("state")), Fault(status.number("faults"))) == (State.FAULT, Fault.HEARTBEAT)
    assert board.pico.cycle - armed_at < 0.1 * HEARTBEAT_MS * CYCLES_PER_MS, "no silence was waited for"
    assert board.ask(Command.FIRE).error is ErrorNumber.FAULT_LATCHED
    assert board.ask(Command.CLEAR).error is None


@pytest.mark.parametrize("lose_the_bus", [UsbHost.suspend, UsbHost.reset])
def test_a_bus_that_is_lost_ends_a_pulse(board: UsbBoard, lose_the_bus: Callable[[UsbHost], None]) -> None:
    board.configure([LONG] * 4)
    board.arm(5)
    board.pico.run_ms(2 * PERIOD_MS)
    into_pulse_ns = 300
    board.when(TRIGGER, True, (LONG.a_start_ns + into_pulse_ns) // CYCLE_NS, lambda: lose_the_bus(board.usb))
    board.pico.edges.clear()
    board.usb.send(encode_request(Request(2300, Command.FIRE, ())))
    board.pico.run_ms(1)
    lights = [edge for edge in board.waveform() if edge[1].startswith("light")]
    assert len(lights) == 8, "four pulses A, no pulse B"
    assert max(at for at, _, high in lights if not high) - LONG.a_start_ns - into_pulse_ns < ABORT_WITHIN_NS
    board.open()


def test_a_host_that_does_not_read_stops_nothing(board: UsbBoard) -> None:
    board.usb.read(False)
    for number in range(2000, 2010):
        board.usb.send(encode_request(Request(number, Command.STATUS, ())))
        board.pico.run_ms(REPLY_LIMIT_MS)
    board.usb.received.clear()
    board.usb.read(True)
    board.pico.run_ms(REPLY_LIMIT_MS)
    assert board.pico.watchdog_resets == []
    assert len(board.usb.received) < KEPT_BYTES
    line = encode_request(Request(2100, Command.STATUS, ()))
    board.say(line)  # the end of the last line that found room may stand before the reply
    assert decode_reply(board.say(line)).sequence == 2100


def test_a_program_that_opens_the_port_gets_nothing_that_was_meant_for_another(board: UsbBoard) -> None:
    board.usb.read(False)
    board.usb.send(encode_request(Request(2200, Command.STATUS, ())))
    board.pico.run_ms(REPLY_LIMIT_MS)
    assert board.request(Setup(0x21, 0x22, 3)) == b""
    board.usb.received.clear()
    board.usb.read(True)
    board.pico.run_ms(1)
    assert len(board.usb.received) < PACKET, "what the controller already had"
    line = encode_request(Request(2201, Command.STATUS, ()))
    board.say(line)
    assert decode_reply(board.say(line)).sequence == 2201


@pytest.mark.parametrize("line", [b"x", b"<\n", b"x\n"])
def test_a_host_that_floods_the_line_keeps_no_fault_from_being_seen(line: bytes) -> None:
    """As fast as the bus permits: bytes come as quickly as they are taken."""
    board = UsbBoard()
    board.configure([PAPER] * 4)
    board.pico.run_ms(2 * PERIOD_MS)
    board.arm(5)
    start = board.pico.cycle

    def flood() -> None:
        board.usb.send(line * (PACKET // len(line)))
        if board.pico.cycle < start + FLOOD_MS * CYCLES_PER_MS:
            board.pico.at(board.pico.cycle + FASTEST_PACKET_NS // CYCLE_NS, flood)

    flood()
    board.pico.run_ms(FLOOD_MS / 2)
    board.pico.short("light0")  # until its power is cut
    board.pico.run_ms(2)
    assert board.pico.set_points_ma() == (0, 0, 0, 0)
    board.pico.run_ms(FLOOD_MS)
    assert board.pico.watchdog_resets == []


def test_a_restart_by_the_watchdog_comes_back_to_the_bus() -> None:
    board = UsbBoard()
    board.pico.hang()
    board.pico.run_ms(WATCHDOG_MS + 10)
    assert len(board.pico.watchdog_resets) == 1
    board.open()
    assert board.usb.resets == 2
    assert State(board.ask(Command.STATUS).number("state")) is State.FAULT
