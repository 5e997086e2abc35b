"""What a flash can do to whoever writes it, and rp2040py's does not: take its time, or nothing at all."""

from rp2040py.rp2040 import RP2040

_READ_STATUS, _NONE, _BUSY = 0x05, 0xFF, 1
_HIGH = 0xFF
"""What a line reads as that nobody drives."""


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
        self._shift = chip.ssi._shift_byte

    def protect(self) -> None:
        """Ignore what is written from now on."""

        def ignore() -> None:
            self._ssi._tx_buffer = bytearray()

        self._ssi._apply_command = ignore  # type: ignore[method-assign]

    def keep_busy_ms(self, time_ms: float) -> None:
        """Be busy for so long from the next question on, and hear nothing but such questions meanwhile."""
        shift = self._ssi._shift_byte
        ends_ns: list[float] = []

        def shift_or_tell(sent: int) -> int:
            is_busy = bool(ends_ns) and self._clock.nanos < ends_ns[0]
            is_heard = bool(self._ssi._tx_buffer) or not is_busy or sent == _READ_STATUS
            answer = shift(sent if is_heard else _NONE)
            if self._ssi._tx_buffer[0] != _READ_STATUS or len(self._ssi._tx_buffer) == 1:
                return answer
            ends_ns[:] = ends_ns or [self._clock.nanos + time_ms * 1e6]
            return answer | (_BUSY if self._clock.nanos < ends_ns[0] else 0)

        self._ssi._shift_byte = shift_or_tell  # type: ignore[method-assign, assignment]

    def fall_silent(self, *, after_bytes: int = 0, for_bytes: int | None = None) -> None:
        """Drive the line no more: after so many bytes from now on, for so many of them, or for ever."""
        shift = self._ssi._shift_byte
        count = 0

        def shift_in_silence(sent: int) -> int:
            nonlocal count
            count += 1
            answer = shift(sent)
            is_over = for_bytes is not None and count > after_bytes + for_bytes
            return answer if count <= after_bytes or is_over else _HIGH

        self._ssi._shift_byte = shift_in_silence  # type: ignore[method-assign, assignment]

    def answer(self) -> None:
        """Be sound again."""
        self._ssi._shift_byte = self._shift  # type: ignore[method-assign]
