"""Images on their way: times against packets counted one by one."""

import pytest

from daq.network import Network

FRAME_BYTES = 1600 * 1200
FOUR = {f"view{number}": 2 * FRAME_BYTES for number in range(1, 5)}


def wire_ns(payload_bytes: int, packet_bytes: int, gbit_s: float, delay_ns: int = 0) -> float:
    """Packet after packet, as an interface sends them: preamble 8, Ethernet 14, the packet, checksum 4, gap 12."""
    time_ns, left = 0.0, payload_bytes
    while left:
        payload = min(left, packet_bytes - 20 - 8 - 8)
        time_ns += 8 * (8 + 14 + (20 + 8 + 8 + payload) + 4 + 12) / gbit_s + delay_ns
        left -= payload
    return time_ns


@pytest.mark.parametrize("packet_bytes", [576, 1500, 9000])
@pytest.mark.parametrize("delay_ns", [0, 2500])
def test_a_camera_sends_packet_after_packet(packet_bytes: int, delay_ns: int) -> None:
    network = Network(packet_bytes, delay_ns)
    expected_ns = wire_ns(2 * FRAME_BYTES, packet_bytes, 1.0, delay_ns)
    assert network.shot_s({"view1": 2 * FRAME_BYTES}) == pytest.approx(expected_ns / 1e9, rel=1e-12)


def test_cameras_that_share_a_wire_wait_for_each_other() -> None:
    assert Network(9000, shared_gbit_s=1.0).shot_s(FOUR) == pytest.approx(4 * Network(9000).shot_s(FOUR))
    assert Network(9000, shared_gbit_s=10.0).shot_s(FOUR) == Network(9000).shot_s(FOUR)


def test_the_slowest_camera_counts() -> None:
    assert Network().shot_s({**FOUR, "view2": 4 * FRAME_BYTES}) == pytest.approx(2 * Network().shot_s(FOUR), rel=1e-3)
