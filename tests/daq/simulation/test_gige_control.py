import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from daq.simulation.camera.gige_control import Command, ControlChannel, ResendRequest, Status
from daq.simulation.camera.gige_registers import PixelFormat, Register, RegisterBank
from daq.simulation.camera.gige_xml import camera_xml

OWNER, OTHER = ("127.0.0.1", 1000), ("127.0.0.1", 2000)
SHAPE = (1200, 1600)
CONTROL = 2


class Client:
    """A GVCP client without a network."""

    def __init__(self) -> None:
        self.bank = RegisterBank("127.0.0.31", "SN31", SHAPE, 8000, camera_xml(SHAPE))
        self.writes: list[tuple[int, int]] = []
        self.resends: list[ResendRequest] = []
        self.channel = ControlChannel(self.bank, lambda *write: self.writes.append(write), self.resends.append)

    def ask(self, command: int, body: bytes, peer: tuple[str, int] = OWNER, now_s: float = 0.0) -> tuple[Status, bytes]:
        request = struct.pack(">BBHHH", 0x42, 1, command, len(body), 77) + body
        answer = self.channel.answer(request, peer, now_s)
        assert answer is not None
        status, acknowledge, length, request_id = struct.unpack_from(">HHHH", answer)
        assert (acknowledge, request_id, length) == (command + 1, 77, len(answer) - 8)
        return Status(status), answer[8:]

    def write(self, register: Register, value: int, peer: tuple[str, int] = OWNER, now_s: float = 0.0) -> Status:
        return self.ask(Command.WRITE_REGISTER, struct.pack(">II", register, value), peer, now_s)[0]

    def read(self, register: Register, peer: tuple[str, int] = OWNER, now_s: float = 0.0) -> int:
        status, body = self.ask(Command.READ_REGISTER, struct.pack(">I", register), peer, now_s)
        assert status is Status.SUCCESS
        return int.from_bytes(body)


@pytest.fixture
def client() -> Client:
    return Client()


def test_a_client_reads_without_control_and_writes_only_with_it(client: Client) -> None:
    assert client.read(Register.WIDTH) == 1600
    assert client.write(Register.WIDTH, 800) is Status.ACCESS_DENIED
    assert client.write(Register.CONTROL_PRIVILEGE, CONTROL) is Status.SUCCESS
    assert client.write(Register.WIDTH, 800) is Status.SUCCESS
    assert client.read(Register.WIDTH) == 800
    assert client.writes[-1] == (Register.WIDTH, 800)


def test_control_belongs_to_one_client_until_it_lets_go(client: Client) -> None:
    client.write(Register.CONTROL_PRIVILEGE, CONTROL)
    assert client.write(Register.CONTROL_PRIVILEGE, CONTROL, OTHER) is Status.ACCESS_DENIED
    assert client.write(Register.CONTROL_PRIVILEGE, 0) is Status.SUCCESS
    assert client.write(Register.CONTROL_PRIVILEGE, CONTROL, OTHER) is Status.SUCCESS


def test_a_silent_client_loses_control_after_the_heartbeat_timeout(client: Client) -> None:
    client.write(Register.CONTROL_PRIVILEGE, CONTROL)
    client.write(Register.ACQUISITION, 1)
    client.read(Register.CONTROL_PRIVILEGE, now_s=2.0)
    client.channel.expire(5.0)
    assert client.read(Register.ACQUISITION, OTHER) == 1
    client.channel.expire(5.01)
    assert client.read(Register.CONTROL_PRIVILEGE, OTHER) == 0
    assert client.read(Register.ACQUISITION, OTHER) == 0
    assert client.writes[-1] == (Register.ACQUISITION, 0)


def test_a_foreign_holder_shuts_everybody_out(client: Client) -> None:
    client.channel.hand_over(True)
    assert client.write(Register.CONTROL_PRIVILEGE, CONTROL) is Status.ACCESS_DENIED
    client.channel.expire(60.0)
    assert client.read(Register.PRIMARY_APPLICATION_PORT) == 50000
    client.channel.hand_over(False)
    assert client.read(Register.CONTROL_PRIVILEGE) == client.read(Register.PRIMARY_APPLICATION_PORT) == 0
    assert client.write(Register.CONTROL_PRIVILEGE, CONTROL) is Status.SUCCESS


@pytest.mark.parametrize(
    ("register", "value", "status"),
    [
        (Register.WIDTH, 1601, Status.INVALID_PARAMETER),
        (Register.HEIGHT, 1201, Status.INVALID_PARAMETER),
        (Register.PIXEL_FORMAT, 0x01080002, Status.INVALID_PARAMETER),
        (Register.PIXEL_FORMAT, PixelFormat.Mono12, Status.SUCCESS),
        (Register.SERIAL_NUMBER, 1, Status.WRITE_PROTECT),
        (Register.EXPOSURE_TIME_NS, 1, Status.WRITE_PROTECT),
    ],
)
def test_a_write_is_refused_with_its_reason(client: Client, register: Register, value: int, status: Status) -> None:
    client.write(Register.CONTROL_PRIVILEGE, CONTROL)
    before = client.read(register)
    assert client.write(register, value) is status
    assert client.read(register) == (value if status is Status.SUCCESS else before)


def test_the_xml_is_where_the_url_says(client: Client) -> None:
    _, url = client.ask(Command.READ_MEMORY, struct.pack(">IHH", Register.XML_URL, 0, 512))
    place, size = (int(part, 16) for part in url[4:].rstrip(b"\0").split(b";")[1:])
    xml = b"".join(
        client.ask(Command.READ_MEMORY, struct.pack(">IHH", place + start, 0, min(512, size - start)))[1][4:]
        for start in range(0, size, 512)
    )
    assert xml.rstrip() == camera_xml(SHAPE)
    assert client.ask(Command.READ_MEMORY, struct.pack(">IHH", place + size, 0, 4))[0] is Status.INVALID_ADDRESS


def test_memory_and_registers_are_the_same_thing(client: Client) -> None:
    client.write(Register.CONTROL_PRIVILEGE, CONTROL)
    body = struct.pack(">III", Register.WIDTH, 640, 480)
    assert client.ask(Command.WRITE_MEMORY, body) == (Status.SUCCESS, struct.pack(">HH", 0, 2))
    assert (client.read(Register.WIDTH), client.read(Register.HEIGHT)) == (640, 480)


def test_a_resend_request_gets_packets_and_no_answer(client: Client) -> None:
    body = struct.pack(">HHII", 0, 65535, 3, 9)
    assert client.channel.answer(struct.pack(">BBHHH", 0x42, 0, 0x40, 12, 1) + body, OWNER, 0.0) is None
    assert client.resends == [ResendRequest(65535, 3, 9)]


def test_an_unknown_command_is_refused(client: Client) -> None:
    assert client.ask(0x55, b"")[0] is Status.NOT_IMPLEMENTED


@given(st.binary(max_size=24), st.sampled_from([*Command, 0x02, 0x99]))
def test_garbage_is_answered_or_ignored_but_never_fatal(body: bytes, command: int) -> None:
    client = Client()
    for request in (body, struct.pack(">BBHHH", 0x42, 1, command, len(body), 1) + body):
        answer = client.channel.answer(request, OWNER, 0.0)
        assert answer is None or struct.unpack_from(">HH", answer)[1] == struct.unpack_from(">H", request, 2)[0] + 1
    assert client.writes == []
