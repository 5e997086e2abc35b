import socket
import struct
import threading
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from daq.shot import Image
from daq.simulation.camera.gige_faults import CameraFaults
from daq.simulation.camera.gige_registers import PixelFormat
from daq.simulation.camera.gige_stream import Block, StreamChannel, last_block_id, next_block_id

blocks = st.builds(
    Block,
    block_id=st.integers(1, 65535),
    timestamp_ns=st.integers(0, 2**63),
    pixel_format=st.sampled_from(PixelFormat),
    shape=st.just((3, 7)),
    payload=st.binary(min_size=1, max_size=400).map(memoryview),
    packet_bytes=st.integers(37, 200),
)


@given(blocks)
def test_the_packets_carry_the_payload_once_and_in_order(block: Block) -> None:
    packets = [block.packet(index) for index in range(block.packet_count)]
    assert b"".join(bytes(payload) for _, payload in packets) == bytes(block.payload)
    for index, (header, _) in enumerate(packets):
        status, block_id, kind_and_index = struct.unpack_from(">HHI", header)
        assert (status, block_id, kind_and_index & 0xFFFFFF) == (0, block.block_id, index)
        assert kind_and_index >> 24 == {0: 1, block.packet_count - 1: 2}.get(index, 3)


@given(blocks)
def test_no_packet_is_larger_than_agreed_and_all_but_the_last_are_full(block: Block) -> None:
    sizes = [28 + len(header) + len(payload) for header, payload in map(block.packet, range(1, block.packet_count - 1))]
    assert max(sizes) <= block.packet_bytes
    assert set(sizes[:-1]) <= {block.packet_bytes}


@given(blocks)
def test_the_leader_tells_time_format_and_size(block: Block) -> None:
    leader, payload = block.packet(0)
    assert not payload
    kind, stamp_ns, pixel_format, columns, rows = struct.unpack_from(">IQIII", leader, 8)
    assert (kind, stamp_ns) == (1, block.timestamp_ns)
    assert (pixel_format, rows, columns) == (block.pixel_format, *block.shape)


def test_the_trailer_tells_the_rows() -> None:
    block = Block(1, 0, PixelFormat.Mono8, (3, 7), memoryview(bytes(21)), 1500)
    assert struct.unpack_from(">II", block.packet(2)[0], 8) == (1, 3)


@pytest.mark.parametrize(
    ("pixel_format", "image", "encoded"),
    [
        (PixelFormat.Mono8, np.full((1, 2), 0xAB, np.uint8), b"\xab\xab"),
        (PixelFormat.Mono12, np.full((1, 2), 0xABC, np.uint16), b"\xbc\x0a\xbc\x0a"),
        (PixelFormat.Mono16, np.full((1, 2), 0xABCD, np.uint16), b"\xcd\xab\xcd\xab"),
    ],
)
def test_words_go_little_endian(pixel_format: PixelFormat, image: Image, encoded: bytes) -> None:
    assert bytes(pixel_format.encode(image)) == encoded


def sent_by(faults: CameraFaults) -> list[int]:
    """Indices of the packets of a block of eight, in the order in which they leave."""
    block = Block(1, 0, PixelFormat.Mono8, (6, 10), memoryview(bytes(60)), 46)
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as here,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as there,
    ):
        for sock in (here, there):
            sock.bind(("127.0.0.1", 0))
            sock.settimeout(5.0)
        StreamChannel(there, 1e9, faults, threading.Event()).send(block, here.getsockname())
        StreamChannel(there, 1e9, CameraFaults(), threading.Event()).send(
            replace(block, block_id=2), here.getsockname()
        )
        found = []
        while (header := struct.unpack_from(">HHI", here.recv(100)))[1] == 1:
            found.append(header[2] & 0xFFFFFF)
    return found


@pytest.mark.parametrize(
    ("faults", "sent"),
    [
        (CameraFaults(), [0, 1, 2, 3, 4, 5, 6, 7]),
        (CameraFaults(packet_loss=1.0), []),
        (CameraFaults(leaders_lost=1), [1, 2, 3, 4, 5, 6, 7]),
        (CameraFaults(trailers_lost=1), [0, 1, 2, 3, 4, 5, 6]),
        (CameraFaults(packets_doubled=1.0), [0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 5, 5, 6, 6, 7, 7]),
        (CameraFaults(packets_swapped=1.0), [1, 2, 3, 4, 5, 6, 7, 0]),
    ],
    ids=["all is well", "lost", "no leader", "no trailer", "doubled", "swapped"],
)
def test_what_happens_to_packets_on_their_way(faults: CameraFaults, sent: list[int]) -> None:
    assert sent_by(faults) == sent


def test_ids_wrap_after_so_many_blocks() -> None:
    ids = [last_block_id(3)]
    for _ in range(4):
        ids.append(next_block_id(ids[-1]))
    assert ids[1:] == [65533, 65534, 65535, 1]
    assert next_block_id(last_block_id(0)) == 1
