"""The number by which one board is told from another: that of its flash, which rp2040py does not have."""

from rp2040py.rp2040 import RP2040

BOARD_NUMBER = bytes.fromhex("E6605838832A4B2F")

_READ_UNIQUE_ID = 0x4B
_DUMMY_BYTES = 5


def give_number(chip: RP2040, number: bytes = BOARD_NUMBER) -> None:
    """Let the flash answer command 4Bh: the command, four bytes that mean nothing, then the number."""
    shift = chip.ssi._shift_byte

    def shift_or_tell(sent: int) -> int:
        answer = shift(sent)
        command = chip.ssi._tx_buffer
        position = len(command) - 1 - _DUMMY_BYTES
        asked = command[0] == _READ_UNIQUE_ID and 0 <= position < len(number)
        return number[position] if asked else answer

    chip.ssi._shift_byte = shift_or_tell  # type: ignore[method-assign, assignment]
