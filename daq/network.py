"""Network: how cameras send images, and how soon the next shot can follow on the wires between. Pure."""

from collections.abc import Mapping
from dataclasses import dataclass

_HEADERS_BYTES = 36
"""Of a stream packet, within its size: IP, UDP and GVSP."""
_ETHERNET_BYTES = 38
"""Around each: preamble, header, checksum and gap."""


@dataclass(frozen=True)
class Network:
    """The wires between cameras and computer.

    Parameters
    ----------
    packet_bytes : int
        Size of a stream packet: 9000 where interfaces and switches carry jumbo frames, else 1500.
    packet_delay_ns : int
        Pause of a camera between packets.
    socket_buffer_bytes : int
        What may wait in the computer for each camera.
    camera_gbit_s : float
        Rate of the wire of one camera.
    shared_gbit_s : float | None
        Rate of the wire that all cameras share on their way to the computer; None: each has its own.
    """

    packet_bytes: int = 1500
    packet_delay_ns: int = 0
    socket_buffer_bytes: int = 4 << 20
    camera_gbit_s: float = 1.0
    shared_gbit_s: float | None = None

    def shot_s(self, view_bytes: Mapping[str, int]) -> float:
        """Time in which the exposures of one shot come over the wires, from the bytes of each view's."""
        each_s = max(self._sent_s(size, self.camera_gbit_s) for size in view_bytes.values())
        if self.shared_gbit_s is None:
            return each_s
        return max(each_s, sum(self._wire_bits(size) for size in view_bytes.values()) / self.shared_gbit_s / 1e9)

    def _sent_s(self, payload_bytes: int, gbit_s: float) -> float:
        return self._wire_bits(payload_bytes) / gbit_s / 1e9 + self._packets(payload_bytes) * self.packet_delay_ns / 1e9

    def _wire_bits(self, payload_bytes: int) -> float:
        return 8.0 * (payload_bytes + self._packets(payload_bytes) * (_HEADERS_BYTES + _ETHERNET_BYTES))

    def _packets(self, payload_bytes: int) -> int:
        return -(-payload_bytes // (self.packet_bytes - _HEADERS_BYTES))
