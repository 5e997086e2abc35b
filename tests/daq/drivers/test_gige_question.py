"""Questions to cameras of other makes: slow ones, and ones that tell nothing but their privilege."""

import socket
import struct
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import monotonic, sleep

import pytest

from daq.drivers.gige_question import Controller, controller_of
from daq.errors import DeviceUnavailable

pytestmark = pytest.mark.network
IP = "127.0.0.39"
OK, NO_SUCH_REGISTER = 0, 0x8003


@contextmanager
def camera(answer: Callable[[int], tuple[int, tuple[int, ...]]], delay_s: float = 0.0) -> Iterator[None]:
    """Something that answers questions for so many registers by a status and values."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind((IP, 3956))

        def serve() -> None:
            question, client = sock.recvfrom(64)
            while question:
                _, _, _, length, number = struct.unpack_from(">BBHHH", question)
                status, values = answer(length // 4)
                sleep(delay_s)
                body = struct.pack(f">{len(values)}I", *values)
                sock.sendto(struct.pack(">HHHH", status, 0x81, len(body), number) + body, client)
                question, client = sock.recvfrom(64)

        thread = threading.Thread(target=serve)
        thread.start()
        try:
            yield
        finally:
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ending:
                ending.sendto(b"", (IP, 3956))
            thread.join()


def tells_all(registers: int) -> tuple[int, tuple[int, ...]]:
    return OK, (2, 50001, 0x0A000001)[:registers]


def tells_privilege(registers: int) -> tuple[int, tuple[int, ...]]:
    return (OK, (2,)) if registers == 1 else (NO_SUCH_REGISTER, ())


def is_free(registers: int) -> tuple[int, tuple[int, ...]]:
    return OK, (0,) * registers


@pytest.mark.parametrize(
    ("answer", "controller"),
    [(tells_all, Controller("10.0.0.1", 50001)), (tells_privilege, Controller()), (is_free, None)],
)
def test_a_camera_tells_who_controls_it_as_far_as_it_can(
    answer: Callable[[int], tuple[int, tuple[int, ...]]], controller: Controller | None
) -> None:
    with camera(answer):
        assert controller_of("view", IP) == controller


def test_a_camera_that_is_slow_answers_in_the_end() -> None:
    with camera(tells_all, delay_s=0.1):
        assert controller_of("view", IP) == Controller("10.0.0.1", 50001)


def test_nonsense_is_no_answer() -> None:
    began_s = monotonic()
    with camera(lambda _: (OK, (1, 2, 3, 4, 5, 6, 7))), pytest.raises(DeviceUnavailable, match=r"within 0\.3 s"):
        controller_of("view", IP, 0.3)
    assert monotonic() - began_s < 5
