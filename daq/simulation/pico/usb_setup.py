"""Setup: the eight bytes with which a USB host begins a control transfer (USB 2.0, section 9.3)."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Setup:
    """A request; the direction is the upper bit of its type."""

    request_type: int
    request: int
    value: int = 0
    index: int = 0
    length: int = 0

    def packed(self) -> bytes:
        """As it is on the bus."""
        words = (self.value, self.index, self.length)
        return bytes((self.request_type, self.request)) + b"".join(word.to_bytes(2, "little") for word in words)
