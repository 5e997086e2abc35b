"""A computer at the USB socket of the emulated board: finds out what the device is, and opens its virtual serial port.

It looks at every packet with the eyes of USB 2.0, chapters 8 and 9. Bits on the wire are not modelled.
"""

from collections.abc import Callable, Generator

from rp2040py.rp2040 import RP2040

from daq.simulation.pico.usb_setup import Setup

PACKET = 64
ADDRESS = 5
DEVICE, CONFIGURATION, STRING = 1, 2, 3

_MEMORY_CONTROL, _MEMORY_BUFFERS = 0x80, 0x100
_AVAILABLE, _DATA1 = 1 << 10, 1 << 13
_ADDR_ENDP, _SIE_CTRL, _SIE_STATUS, _STALL_ARM = 0x00, 0x4C, 0x50, 0x68
_PULL_UP = 1 << 16
_SIE_SUSPENDED = 1 << 4
_TO_DEVICE, _FROM_DEVICE, _CLASS_INTERFACE = 0x00, 0x80, 0x21
_GET_DESCRIPTOR, _SET_ADDRESS, _SET_CONFIGURATION = 6, 5, 9
_SET_LINE_CODING, _GET_LINE_CODING, _SET_CONTROL_LINES = 0x20, 0x21, 0x22
_PAUSE_NS = 100_000
_ENGLISH = 0x0409


class BrokenDevice(Exception):
    """The device did what a host does not accept."""


_Steps = Generator[None, None, bytes | None]


class UsbHost:
    """Starts when the device shows itself; one control transfer after the other, and the data of the serial port.

    Attributes
    ----------
    descriptors : dict[int, bytes]
        By type: device and configuration.
    strings : tuple[str, ...]
        Manufacturer, product, serial number.
    is_open : bool
        Whether a program has opened the port.
    resets : int
        Times that the device has come to the bus.
    received : bytearray
        What the device sent through its port; the caller may clear it.
    longest_packet : int
        Bytes in the longest packet of it.
    """

    def __init__(self, chip: RP2040) -> None:
        self._chip, self._usb = chip, chip.usb_ctrl
        self._alarm = chip.clock.create_alarm(self._go_on)
        self.resets = 0
        self.received = bytearray()
        self.longest_packet = 0
        self._reading = True
        self._forget()
        self._usb.on_usb_enabled = self._usb.reset_device
        self._usb.on_reset_received = self._on_reset
        self._usb.on_endpoint_write = self._on_in
        self._usb.on_endpoint_read = self._on_out
        self._usb.on_reset = self._forget
        self._watch_memory()
        self._watch_stalls()

    def send(self, data: bytes) -> None:
        """Through the serial port, packet by packet as the device takes them."""
        self._unsent.extend(data)
        self._send_next()

    def read(self, reading: bool) -> None:
        """Whether somebody fetches what the device sends."""
        self._reading = reading
        while reading and self._withheld:
            self._tell_memory(*self._withheld.pop(0))

    def suspend(self) -> None:
        """The bus falls silent for more than 3 ms, as before a computer sleeps."""
        self._usb._sie_status |= _SIE_SUSPENDED
        self._usb._sie_status_updated()

    def reset(self) -> None:
        """The bus is reset, and the device enumerated anew."""
        self._usb._on_reset_alarm()

    def ask(self, setup: Setup, data: bytes = b"") -> Callable[[], tuple[bool, bytes | None]]:
        """Start a control transfer; the function tells whether it has ended, and what came: None for a refusal."""
        outcome: list[bytes | None] = []

        def steps() -> _Steps:
            outcome.append((yield from self._transfer(setup, data)))
            return None

        self._begin(steps())
        return lambda: (bool(outcome), outcome[0] if outcome else None)

    def _forget(self) -> None:
        self._steps: _Steps | None = None
        self._alarm.cancel()
        self._in_packets: list[tuple[bytes, bool]] = []
        self._in_pids: dict[int, list[bool]] = {}
        self._armed: dict[int, tuple[int, bool]] = {}
        self._expected_data1: dict[tuple[int, bool], bool] = {}
        self._stalled = False
        self._unsent = bytearray()
        self.descriptors: dict[int, bytes] = {}
        self.strings: tuple[str, ...] = ()
        self.is_open = False
        self._address = 0
        self._withheld: list[tuple[int, int]] = []

    def _watch_memory(self) -> None:
        """The data toggle of every buffer, when it is handed over."""
        self._tell_memory = self._usb.dpram_updated

        def updated(offset: int, value: int) -> None:
            if value & _AVAILABLE and _MEMORY_CONTROL <= offset < _MEMORY_BUFFERS:
                number, is_out = (offset - _MEMORY_CONTROL) >> 3, bool(offset & 4)
                data1 = bool(value & _DATA1)
                if is_out:
                    self._armed[number] = (value & 0x3FF, data1)
                else:
                    self._check_address()
                    self._in_pids.setdefault(number, []).append(data1)
                if number and not is_out and not self._reading:
                    self._withheld.append((offset, value))
                    return
            self._tell_memory(offset, value)

        self._usb.dpram_updated = updated  # type: ignore[method-assign]

    def _watch_stalls(self) -> None:
        write = self._usb.write_uint32

        def write_and_tell(offset: int, value: int) -> None:
            if offset == _SIE_STATUS:  # the emulator does not clear this bit of it
                self._usb._sie_status &= ~(self._usb.raw_write_value & _SIE_SUSPENDED)
            write(offset, value)
            if offset == _STALL_ARM and value:
                self._stalled = True
                self._alarm.schedule(_PAUSE_NS)

        self._usb.write_uint32 = write_and_tell  # type: ignore[method-assign]

    def _on_reset(self) -> None:
        if not self._usb.read_uint32(_SIE_CTRL) & _PULL_UP:
            raise BrokenDevice("nothing pulls up: the host cannot see the device")
        self._forget()
        self.resets += 1
        self._begin(self._enumerate())

    def _begin(self, steps: _Steps) -> None:
        if self._steps is not None:
            raise BrokenDevice("the transfer before has not ended")
        self._steps = steps
        self._alarm.schedule(_PAUSE_NS)

    def _go_on(self) -> None:
        if self._steps is None:
            return
        try:
            next(self._steps)
        except StopIteration:
            self._steps = None

    def _on_in(self, number: int, packet: bytes | bytearray) -> None:
        data1 = self._in_pids[number].pop(0)
        if number == 0:
            self._in_packets.append((bytes(packet), data1))
            self._alarm.schedule(_PAUSE_NS)
            return
        self._check_toggle(number, False, data1)
        self.longest_packet = max(self.longest_packet, len(packet))
        self.received.extend(packet)

    def _on_out(self, number: int, _size: int) -> None:
        if number:
            self._send_next()
        else:
            self._alarm.schedule(_PAUSE_NS)

    def _check_toggle(self, number: int, is_out: bool, data1: bool) -> None:
        expected = self._expected_data1.get((number, is_out), False)
        if data1 != expected:
            raise BrokenDevice(f"endpoint {number}: DATA{int(data1)} for DATA{int(expected)}")
        self._expected_data1[number, is_out] = not expected

    def _send_next(self) -> None:
        for number in [number for number in self._armed if number and self._unsent]:
            size, data1 = self._armed.pop(number)
            self._check_toggle(number, True, data1)
            packet = bytes(self._unsent[:size])
            del self._unsent[:size]
            self._usb.endpoint_read_done(number, packet)

    def _check_address(self) -> None:
        """A new address counts from the end of the transfer that gives it."""
        address = self._usb.read_uint32(_ADDR_ENDP)
        if address != self._address:
            raise BrokenDevice(f"listens at address {address}, not {self._address}")

    def _transfer(self, setup: Setup, data: bytes = b"") -> _Steps:
        self._check_address()
        self._stalled = False
        self._in_packets.clear()
        self._armed.pop(0, None)
        self._usb.send_setup_packet(setup.packed())
        yield
        if setup.request_type & _FROM_DEVICE:
            return (yield from self._data_from_device(setup.length))
        return (yield from self._data_to_device(data))

    def _data_from_device(self, length: int) -> _Steps:
        data, data1 = b"", True
        while True:
            while not self._in_packets and not self._stalled:
                yield
            if self._stalled:
                return None
            packet, is_data1 = self._in_packets.pop(0)
            if is_data1 != data1:
                raise BrokenDevice(f"control: DATA{int(is_data1)} after {len(data)} bytes")
            data, data1 = data + packet, not data1
            if len(packet) < PACKET or len(data) >= length:
                break
        if len(data) > length:
            raise BrokenDevice(f"control: {len(data)} bytes where {length} were asked for")
        yield from self._give(b"")
        return data

    def _data_to_device(self, data: bytes) -> _Steps:
        if data and not self._stalled:
            yield from self._give(data)
        while not self._in_packets and not self._stalled:
            yield
        if self._stalled:
            return None
        if self._in_packets.pop(0) != (b"", True):
            raise BrokenDevice("control: the acknowledgement is an empty DATA1")
        return b""

    def _give(self, data: bytes) -> _Steps:
        while 0 not in self._armed and not self._stalled:
            yield
        if not self._stalled:
            _, data1 = self._armed.pop(0)
            if not data1:
                raise BrokenDevice("control: expects DATA0 from the host")
            self._usb.endpoint_read_done(0, data)
            self._alarm.schedule(_PAUSE_NS)
            yield
        return None

    def _descriptor(self, kind: int, index: int, length: int, language: int = 0) -> _Steps:
        return self._transfer(Setup(_FROM_DEVICE, _GET_DESCRIPTOR, kind << 8 | index, language, length))

    def _enumerate(self) -> _Steps:
        """As Linux does it: a first look, an address, everything, a configuration; then a program opens the port."""
        first = yield from self._needed(self._descriptor(DEVICE, 0, PACKET))
        yield from self._needed(self._transfer(Setup(_TO_DEVICE, _SET_ADDRESS, ADDRESS)))
        self._address = ADDRESS
        device = yield from self._needed(self._descriptor(DEVICE, 0, first[0]))
        header = yield from self._needed(self._descriptor(CONFIGURATION, 0, 9))
        whole = yield from self._needed(self._descriptor(CONFIGURATION, 0, int.from_bytes(header[2:4], "little")))
        self.descriptors = {DEVICE: device, CONFIGURATION: whole}
        strings = []
        for index in device[14:17]:
            text = yield from self._needed(self._descriptor(STRING, index, 255, _ENGLISH))
            strings.append(text[2:].decode("utf-16-le"))
        self.strings = tuple(strings)
        yield from self._needed(self._transfer(Setup(_TO_DEVICE, _SET_CONFIGURATION, whole[5])))
        coding = (115_200).to_bytes(4, "little") + bytes((0, 0, 8))
        yield from self._needed(self._transfer(Setup(_CLASS_INTERFACE, _SET_LINE_CODING, length=7), coding))
        kept = yield from self._needed(
            self._transfer(Setup(_CLASS_INTERFACE | _FROM_DEVICE, _GET_LINE_CODING, length=7))
        )
        if kept != coding:
            raise BrokenDevice(f"line coding {kept.hex()}, set was {coding.hex()}")
        yield from self._needed(self._transfer(Setup(_CLASS_INTERFACE, _SET_CONTROL_LINES, 3)))
        self.is_open = True
        return None

    def _needed(self, steps: _Steps) -> Generator[None, None, bytes]:
        answer = yield from steps
        if answer is None:
            raise BrokenDevice("refuses a request that every device carries out")
        return answer
