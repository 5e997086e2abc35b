"""Register bank of a simulated GigE Vision camera: bootstrap registers, features, and the XML behind them."""

import socket
import struct
from enum import IntEnum

import numpy as np

from daq.shot import Image


class Register(IntEnum):
    """Addresses: bootstrap registers as in GigE Vision 1.2, features of this camera from 0x8000 on."""

    VERSION = 0x0000
    DEVICE_MODE = 0x0004
    MAC_HIGH = 0x0008
    MAC_LOW = 0x000C
    IP_CAPABILITIES = 0x0010
    IP_CONFIGURATION = 0x0014
    CURRENT_IP = 0x0024
    SUBNET_MASK = 0x0034
    VENDOR_NAME = 0x0048
    MODEL_NAME = 0x0068
    DEVICE_VERSION = 0x0088
    SERIAL_NUMBER = 0x00D8
    XML_URL = 0x0200
    INTERFACE_COUNT = 0x0600
    STREAM_CHANNEL_COUNT = 0x0904
    GVCP_CAPABILITIES = 0x0934
    HEARTBEAT_TIMEOUT_MS = 0x0938
    TICK_FREQUENCY_HIGH = 0x093C
    TICK_FREQUENCY_LOW = 0x0940
    TIMESTAMP_CONTROL = 0x0944
    TIMESTAMP_HIGH = 0x0948
    TIMESTAMP_LOW = 0x094C
    CONTROL_PRIVILEGE = 0x0A00
    PRIMARY_APPLICATION_PORT = 0x0A04
    PRIMARY_APPLICATION_IP = 0x0A14
    STREAM_PORT = 0x0D00
    STREAM_PACKET_SIZE = 0x0D04
    STREAM_PACKET_DELAY = 0x0D08
    STREAM_ADDRESS = 0x0D18
    STREAM_SOURCE_PORT = 0x0D1C

    WIDTH = 0x8000
    HEIGHT = 0x8004
    OFFSET_X = 0x8008
    OFFSET_Y = 0x800C
    PIXEL_FORMAT = 0x8010
    ACQUISITION_MODE = 0x8014
    ACQUISITION = 0x8018
    TRIGGER_SELECTOR = 0x801C
    TRIGGER_MODE = 0x8020
    TRIGGER_SOURCE = 0x8024
    TRIGGER_ACTIVATION = 0x8028
    EXPOSURE_MODE = 0x802C
    EXPOSURE_TIME_NS = 0x8030


class PixelFormat(IntEnum):
    """PFNC codes; the unpacked formats carry 10 to 16 bits in little-endian words."""

    Mono8 = 0x01080001
    Mono10 = 0x01100003
    Mono12 = 0x01100005
    Mono14 = 0x01100025
    Mono16 = 0x01100007

    @property
    def bits(self) -> int:
        """Significant bits of a grey value."""
        return int(self.name.removeprefix("Mono"))

    def encode(self, image: Image) -> memoryview:
        """Bytes of an image as they go on the wire."""
        return memoryview(image.astype(np.uint8 if self.bits == 8 else "<u2").tobytes())


_PIXEL_FORMATS = frozenset(int(pixel_format) for pixel_format in PixelFormat)


class ExposureMode(IntEnum):
    """One exposure per trigger edge; two; or two that leave as one image, A above B."""

    Timed = 0
    DoubleFrame = 1
    StackedDoubleFrame = 2


class TriggerSource(IntEnum):
    """Inputs that may start an exposure."""

    Software = 0
    Line1 = 1


XML_ADDRESS = 0x10000
TICK_FREQUENCY_HZ = 1_000_000_000
STREAM_PACKET_SIZE_MASK = 0xFFFF
LATCH_TIMESTAMP = 2

_MULTIPLE_REGISTERS, _MEMORY_WRITE, _PACKET_RESEND = 1, 2, 4
_FIXED_ADDRESS = 5
_WRITABLE = frozenset(
    {
        Register.HEARTBEAT_TIMEOUT_MS,
        Register.TIMESTAMP_CONTROL,
        Register.CONTROL_PRIVILEGE,
        Register.STREAM_PORT,
        Register.STREAM_PACKET_SIZE,
        Register.STREAM_PACKET_DELAY,
        Register.STREAM_ADDRESS,
    }
) | frozenset(Register(address) for address in range(Register.WIDTH, Register.EXPOSURE_TIME_NS, 4))


class RegisterBank:
    """Memory of the camera: 32-bit big-endian registers, strings, and the GenICam XML from ``XML_ADDRESS`` on.

    Parameters
    ----------
    ip, serial : str
        Address and serial number the camera answers with.
    sensor_shape : tuple[int, int]
        (rows, columns) of the sensor: the largest exposure.
    exposure_ns : int
        Length of exposure A, as the ExposureTime feature reports it.
    xml : bytes
        GenICam description.
    """

    def __init__(self, ip: str, serial: str, sensor_shape: tuple[int, int], exposure_ns: int, xml: bytes) -> None:
        padded = xml + b"\n" * (-len(xml) % 4)
        self._memory = bytearray(XML_ADDRESS) + padded
        self._limits = {
            Register.WIDTH: sensor_shape[1],
            Register.HEIGHT: sensor_shape[0],
            Register.EXPOSURE_MODE: max(ExposureMode),
            Register.TRIGGER_SOURCE: max(TriggerSource),
        }
        url = f"Local:tomoshadow_double_frame.xml;{XML_ADDRESS:x};{len(padded):x}"
        self._describe({Register.VENDOR_NAME: "tomoshadow", Register.MODEL_NAME: "Simulated double-frame camera"})
        self._describe({Register.DEVICE_VERSION: "1.0", Register.SERIAL_NUMBER: serial, Register.XML_URL: url})
        self._preset(int.from_bytes(socket.inet_aton(ip)), sensor_shape, exposure_ns)

    def _describe(self, texts: dict[Register, str]) -> None:
        for register, text in texts.items():
            self._memory[register : register + len(text)] = text.encode("ascii")

    def _preset(self, ip: int, sensor_shape: tuple[int, int], exposure_ns: int) -> None:
        presets = {
            Register.VERSION: 0x0001_0002,
            Register.DEVICE_MODE: 0x8000_0001,
            Register.MAC_HIGH: 0x0200,
            Register.MAC_LOW: ip,
            Register.IP_CAPABILITIES: _FIXED_ADDRESS,
            Register.IP_CONFIGURATION: _FIXED_ADDRESS,
            Register.CURRENT_IP: ip,
            Register.SUBNET_MASK: 0xFF00_0000,
            Register.INTERFACE_COUNT: 1,
            Register.STREAM_CHANNEL_COUNT: 1,
            Register.GVCP_CAPABILITIES: _MULTIPLE_REGISTERS | _MEMORY_WRITE | _PACKET_RESEND,
            Register.HEARTBEAT_TIMEOUT_MS: 3000,
            Register.TICK_FREQUENCY_LOW: TICK_FREQUENCY_HZ,
            Register.STREAM_PACKET_SIZE: 1500,
            Register.WIDTH: sensor_shape[1],
            Register.HEIGHT: sensor_shape[0],
            Register.PIXEL_FORMAT: PixelFormat.Mono8,
            Register.TRIGGER_SOURCE: TriggerSource.Software,
            Register.EXPOSURE_TIME_NS: exposure_ns,
        }
        for register, value in presets.items():
            self[register] = value

    def __getitem__(self, register: int) -> int:
        return int(struct.unpack_from(">I", self._memory, register)[0])

    def __setitem__(self, register: int, value: int) -> None:
        struct.pack_into(">I", self._memory, register, value)

    def read(self, address: int, size: int) -> bytes | None:
        """Memory content; None beyond its end."""
        return bytes(self._memory[address : address + size]) if address + size <= len(self._memory) else None

    def is_writable(self, address: int) -> bool:
        """True for registers that a client may write."""
        return address in _WRITABLE

    def is_legal(self, address: int, value: int) -> bool:
        """True where the value lies within the limits of the register."""
        if address == Register.PIXEL_FORMAT:
            return value in _PIXEL_FORMATS
        limit = self._limits.get(Register(address))
        return limit is None or 0 <= value <= limit

    @property
    def image_shape(self) -> tuple[int, int]:
        """(rows, columns) of one exposure as configured."""
        return self[Register.HEIGHT], self[Register.WIDTH]

    @property
    def pixel_format(self) -> PixelFormat:
        """Pixel format as configured."""
        return PixelFormat(self[Register.PIXEL_FORMAT])

    @property
    def frames_per_trigger(self) -> int:
        """Exposures that one trigger edge starts."""
        return 1 if self[Register.EXPOSURE_MODE] == ExposureMode.Timed else 2

    @property
    def is_stacked(self) -> bool:
        """Both exposures leave as one image."""
        return self[Register.EXPOSURE_MODE] == ExposureMode.StackedDoubleFrame

    def latch_timestamp(self, ticks: int) -> None:
        """Publish the device clock."""
        self[Register.TIMESTAMP_HIGH] = ticks >> 32
        self[Register.TIMESTAMP_LOW] = ticks & 0xFFFF_FFFF
