"""What a flash can do to whoever writes it, and rp2040py's does not: take its time, or nothing at all."""

from rp2040py.rp2040 import RP2040

_READ_STATUS, _BUSY = 0x05, 1


class FlashChip:
    """The flash of a chip, until its next power-up.

    Attributes
    ----------
    contents : bytearray
        May be changed behind the firmware's back.
    """

    def __init__(self, chip: RP2040) -> None:
        self.contents: bytearray = chip.flash
        self._ssi, self._clock = chip.ssi, chip.clock

    def protect(self) -> None:
        """Ignore what is written from now on."""

        def ignore() -> None:
            self._ssi._tx_buffer = bytearray()

        self._ssi._apply_command = ignore  # type: ignore[method-assign]

    def keep_busy_ms(self, time_ms: float) -> None:
        """Be busy for so long from the next question on."""
        shift = self._ssi._shift_byte
        ends_ns: list[float] = []

        def shift_or_tell(sent: int) -> int:
            answer = shift(sent)
            if self._ssi._tx_buffer[0] != _READ_STATUS or len(self._ssi._tx_buffer) == 1:
                return answer
            ends_ns[:] = ends_ns or [self._clock.nanos + time_ms * 1e6]
            return answer | (_BUSY if self._clock.nanos < ends_ns[0] else 0)

        self._ssi._shift_byte = shift_or_tell  # type: ignore[method-assign, assignment]
