"""One GigE Vision device and its stream, through Aravis. The only module that knows ``gi``.

Devices are opened by IP address, which sends nothing to anybody else; discovery would broadcast.
Aravis objects belong to one thread each: the device to the one that arms, the stream to the one that pops.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from threading import Event
from time import monotonic
from typing import Any

import gi
import numpy as np
from numpy.typing import NDArray

from daq.devices import DeviceIdentity
from daq.drivers.camera_profile import FeatureValue, FeatureWrite
from daq.drivers.exposure_pairing import Arrival, ExposureFormat
from daq.drivers.gige_question import controller_of
from daq.errors import DeviceRefused, DeviceTimeout, DeviceUnavailable

gi.require_version("Aravis", "0.8")
from gi.repository import Aravis, GLib  # noqa: E402  the version must be required first

# PyGObject fills an enumeration when it is first asked for; a thread that asks meanwhile finds it empty. So ask now.
_WHOLE, _NO_ANSWER = Aravis.BufferStatus.SUCCESS, Aravis.DeviceError.TIMEOUT

_REGISTER_LIMIT_S = 2.5  # Aravis asks five times, half a second each
_CONTROL_LIMIT_S = 6.0  # control of a client that was killed expires 3 s after its last heartbeat
_CONTROL_RETRY_S = 0.25
_BUFFERS = 8
_POLL_US = 50_000
# Shots come one by one: rather late than incomplete. Aravis would give up after 0.1 s, or a tenth of the packets.
_FRAME_RETENTION_US = 500_000
_RESEND_RATIO = 1.0

# Bootstrap registers of GigE Vision 1.2: every camera that has a clock has these.
_TICK_FREQUENCY_HIGH, _TICK_FREQUENCY_LOW = 0x093C, 0x0940
_TIMESTAMP_CONTROL, _TIMESTAMP_HIGH, _TIMESTAMP_LOW = 0x0944, 0x0948, 0x094C
_LATCH = 2
_PACKET_DELAY = 0x0D08  # of the first stream channel, in ticks


class AravisDevice:
    """Control channel of a camera that this process holds.

    Parameters
    ----------
    name : str
        Name in the rig configuration; errors carry it.
    ip : str
        Address of the camera.

    Raises
    ------
    DeviceUnavailable
        Nothing answers at this address, or another client holds the camera for longer than its
        heartbeat would allow a dead one.
    DeviceRefused
        The camera has no clock: nothing could prove to which firing a frame belongs.
    """

    def __init__(self, name: str, ip: str) -> None:
        self._name = name
        self._ip = ip
        self._lost = lost = Event()
        self._camera = self._connect()
        self._device = self._camera.get_device()
        # Comes from a thread of Aravis. It must not refer to self: a cycle would put off the closing of the device.
        self._device.connect("control-lost", lambda *_: lost.set())
        self._take_control()
        self._camera.set_range_check_policy(Aravis.RangeCheckPolicy.ENABLE)
        self._tick_hz = self._read_wide(_TICK_FREQUENCY_HIGH, _TICK_FREQUENCY_LOW)
        if not self._tick_hz:
            raise DeviceRefused(name, f"the camera at {ip} has no clock (timestamp tick frequency 0)")

    @property
    def is_lost(self) -> bool:
        """The camera has stopped answering, or has been taken by another client."""
        return self._lost.is_set()

    def lose(self) -> None:
        """Take note that the camera has let go of us; nothing is asked of it any more."""
        self._lost.set()

    def require_answer(self) -> None:
        """Raise DeviceUnavailable if the camera is lost."""
        if self.is_lost:
            raise DeviceUnavailable(self._name, f"the camera at {self._ip} has stopped answering, or was taken over")

    def identity(self) -> DeviceIdentity:
        """Who the camera says it is."""
        with self._typed_errors("identity"):
            return DeviceIdentity(
                vendor=self._camera.get_vendor_name(),
                model=self._camera.get_model_name(),
                serial=self._camera.get_device_serial_number(),
                firmware=self._camera.get_string("DeviceVersion"),
            )

    def has(self, feature: str) -> bool:
        """True if the camera has this feature at present."""
        with self._typed_errors(feature):
            return bool(self._camera.is_feature_available(feature))

    def write(self, setting: FeatureWrite) -> None:
        """Write one feature."""
        with self._typed_errors(f"{setting.feature} = {setting.value}"):
            match setting.value:
                case bool():
                    self._camera.set_boolean(setting.feature, setting.value)
                case int():
                    self._camera.set_integer(setting.feature, setting.value)
                case float():
                    self._camera.set_float(setting.feature, setting.value)
                case str():
                    self._camera.set_string(setting.feature, setting.value)

    def check(self, setting: FeatureWrite) -> None:
        """Read one feature back; DeviceRefused if it is not what was written."""
        actual = self._read(setting)
        if not setting.is_met_by(actual):
            raise DeviceRefused(self._name, f"{setting.feature} reads {actual!r} after writing {setting.value!r}")

    def set_packets(self, packet_bytes: int, packet_delay_ns: int) -> None:
        """Fix size and distance of stream packets, and read them back; the automatic size of Aravis is not dependable.

        Raises
        ------
        DeviceRefused
            The camera does not take the size, or no pause as long as that.
        """
        with self._typed_errors(f"packet size {packet_bytes}"):
            self._camera.gv_set_packet_size_adjustment(Aravis.GvPacketSizeAdjustment.NEVER)
            self._camera.gv_set_packet_size(packet_bytes)
            taken_bytes = self._camera.gv_get_packet_size()
        if taken_bytes != packet_bytes:
            raise DeviceRefused(self._name, f"sends packets of {taken_bytes} bytes, not {packet_bytes}")
        delay_ticks = -(-packet_delay_ns * self._tick_hz // 1_000_000_000)
        with self._typed_errors(f"packet delay {packet_delay_ns} ns"):
            self._device.write_register(_PACKET_DELAY, delay_ticks)
            taken_ticks = self._device.read_register(_PACKET_DELAY)
        if taken_ticks != delay_ticks:
            pauses_ns = 1e9 * taken_ticks / self._tick_hz
            raise DeviceRefused(self._name, f"pauses {pauses_ns:g} ns between packets, not {packet_delay_ns}")

    def open_stream(self, form: ExposureFormat, socket_buffer_bytes: int) -> "AravisStream":
        """A fresh stream, so that no frame of an earlier acquisition is in it."""
        with self._typed_errors("stream"):
            stream = self._camera.create_stream(None, None)
            return AravisStream(stream, self._camera.get_payload(), form, socket_buffer_bytes)

    def start(self) -> None:
        """Start acquisition."""
        with self._typed_errors("AcquisitionStart"):
            self._camera.start_acquisition()

    def stop(self) -> None:
        """Stop acquisition."""
        with self._typed_errors("AcquisitionStop"):
            self._camera.stop_acquisition()

    def clock_ns(self) -> int:
        """The camera's clock, now."""
        with self._typed_errors("timestamp latch"):
            self._device.write_register(_TIMESTAMP_CONTROL, _LATCH)
            ticks = self._read_wide(_TIMESTAMP_HIGH, _TIMESTAMP_LOW)
        return ticks * 1_000_000_000 // self._tick_hz

    def close(self) -> None:
        """Give up control. Takes long if the camera does not answer."""
        self._device = self._camera = None

    def _connect(self) -> Any:
        try:
            return Aravis.Camera.new(self._ip)
        except GLib.Error as error:
            raise DeviceUnavailable(self._name, f"no camera answers at {self._ip} ({error.message})") from error

    def _take_control(self) -> None:
        deadline_s = monotonic() + _CONTROL_LIMIT_S
        while not self._device.is_controller() and not self._try_to_take_control():
            if monotonic() > deadline_s:
                holder = controller_of(self._name, self._ip) or "another client"
                reason = f"the camera at {self._ip} is held by {holder}, still after {_CONTROL_LIMIT_S:g} s"
                raise DeviceUnavailable(self._name, reason)
            self._lost.wait(_CONTROL_RETRY_S)
        self._lost.clear()

    def _try_to_take_control(self) -> bool:
        try:
            return bool(self._device.take_control())
        except GLib.Error:
            return False

    def _read(self, setting: FeatureWrite) -> FeatureValue:
        with self._typed_errors(f"read {setting.feature}"):
            match setting.value:
                case bool():
                    return bool(self._camera.get_boolean(setting.feature))
                case int():
                    return int(self._camera.get_integer(setting.feature))
                case float():
                    return float(self._camera.get_float(setting.feature))
                case str():
                    return str(self._camera.get_string(setting.feature))

    def _read_wide(self, high: int, low: int) -> int:
        with self._typed_errors(f"register {low:#06x}"):
            return int(self._device.read_register(high)) << 32 | int(self._device.read_register(low))

    @contextmanager
    def _typed_errors(self, command: str) -> Iterator[None]:
        self.require_answer()
        try:
            yield
        except GLib.Error as error:
            if error.matches(Aravis.device_error_quark(), _NO_ANSWER):
                self._lost.set()
                raise DeviceTimeout(self._name, command, _REGISTER_LIMIT_S) from error
            denied = "; another client has control, or the camera was without power" * (
                "access-denied" in error.message
            )
            raise DeviceRefused(self._name, f"{command}: {error.message}{denied}") from error


class AravisStream:
    """Frames of one acquisition. Its buffers are numpy arrays that Aravis fills in place.

    Parameters
    ----------
    stream : Aravis.Stream
        As the camera made it.
    payload_bytes : int
        Size of one image on the wire.
    form : ExposureFormat
        What a frame must look like.
    socket_buffer_bytes : int
        What may wait in the socket.
    """

    def __init__(self, stream: Any, payload_bytes: int, form: ExposureFormat, socket_buffer_bytes: int) -> None:
        self._stream = stream
        self._form = form
        self._missing_packets = 0
        self._resent_packets = 0
        stream.set_property("socket-buffer", Aravis.GvStreamSocketBuffer.FIXED)
        stream.set_property("socket-buffer-size", socket_buffer_bytes)
        stream.set_property("frame-retention", _FRAME_RETENTION_US)
        stream.set_property("packet-request-ratio", _RESEND_RATIO)
        self._memory: dict[Any, NDArray[np.uint8]] = {}
        for _ in range(_BUFFERS):
            memory = np.empty(payload_bytes, np.uint8)
            buffer = Aravis.Buffer.new(memory.nbytes, memory.ctypes.data)
            self._memory[buffer] = memory
            stream.push_buffer(buffer)

    def pop(self) -> Arrival | None:
        """Next frame, copied out of its buffer; None if none came within 50 ms."""
        buffer = self._stream.timeout_pop_buffer(_POLL_US)
        if buffer is None:
            return None
        arrival = self._arrival(buffer)
        self._stream.push_buffer(buffer)
        return arrival

    def close(self) -> None:
        """End the stream. Takes long if the camera does not answer."""
        self._stream = None

    def _arrival(self, buffer: Any) -> Arrival:
        missing, resent = self._count("n_missing_packets"), self._count("n_resent_packets")
        arrived = buffer.get_status() == _WHOLE
        whole = arrived and self._fits(buffer)
        arrival = Arrival(
            frame_id=int(buffer.get_frame_id()),
            device_timestamp_ns=int(buffer.get_timestamp()) if whole else 0,
            image=self._form.image_of(self._memory[buffer]) if whole else None,
            missing_packets=missing - self._missing_packets,
            resent_packets=resent - self._resent_packets,
            wrong_size=arrived and not whole,
        )
        self._missing_packets, self._resent_packets = missing, resent
        return arrival

    def _fits(self, buffer: Any) -> bool:
        return (buffer.get_image_height(), buffer.get_image_width()) == self._form.arrival_shape

    def _count(self, name: str) -> int:
        return int(self._stream.get_info_uint64_by_name(name))
