"""The time that bytes take on the serial line of the emulated board; rp2040py sends them in none."""

from rp2040py.peripherals.peripheral import BasePeripheral, Peripheral
from rp2040py.rp2040 import RP2040

BYTE_NS = 10 * 1_000_000_000 // 115_200

_UART0 = 0x40034
_DATA, _FLAGS = 0x00, 0x18
_TX_FULL = 1 << 5


def pace_serial_line(chip: RP2040) -> None:
    """Let the firmware wait for its replies to be sent, from now on until the next power-up."""
    chip.peripherals[_UART0] = _PacedUart(chip, chip.peripherals[_UART0])


class _PacedUart(BasePeripheral):
    """A UART without FIFO in front of the emulator's: one byte on the line, one waits, more find it full."""

    def __init__(self, chip: RP2040, inner: Peripheral) -> None:
        super().__init__(chip, "UART0")
        self._chip = chip
        self._inner = inner
        self._sent_ns = 0.0

    def read_uint32(self, offset: int) -> int:
        value: int = self._inner.read_uint32(offset)
        full = offset == _FLAGS and self._sent_ns - self._chip.clock.nanos > BYTE_NS
        return value | _TX_FULL if full else value

    def write_uint32(self, offset: int, value: int) -> None:
        if offset == _DATA:
            self._sent_ns = max(self._sent_ns, self._chip.clock.nanos) + BYTE_NS
        self._inner.write_uint32(offset, value)
