"""GigE Vision double-frame camera: arms it by its profile, and proves that two frames are exposures A and B."""

import logging
from dataclasses import replace
from threading import Lock, Thread
from time import monotonic_ns
from types import TracebackType
from typing import TYPE_CHECKING, Self

from daq.devices import DeviceIdentity
from daq.drivers.camera_profile import CameraProfile
from daq.drivers.exposure_pairing import ExposureFormat, double_frame
from daq.drivers.frame_receiver import FrameReceiver, StreamCounters
from daq.drivers.gige_question import Controller, controller_of
from daq.errors import DeviceError, DeviceRefused, DeviceUnavailable
from daq.network import Network
from daq.shot import DoubleFrame
from daq.timing import CameraTiming

if TYPE_CHECKING:
    from daq.drivers.aravis_device import AravisDevice

_log = logging.getLogger(__name__)

ARAVIS_REMEDY = "apt install python3-gi gir1.2-aravis-0.8, and a virtual environment with --system-site-packages"
"""No package index has them, so Debian's must be seen."""
_RELEASE_LIMIT_S = 2.0
_CLOCK_LAG_NS = 50_000_000
"""By more, between two shots, no clock is slow: it was set back."""


def load_aravis(name: str) -> "type[AravisDevice]":
    """Import Aravis, here and not above: all but cameras works on a computer without it.

    Raises
    ------
    DeviceUnavailable
        It is missing; the text names the packages to install.
    """
    try:
        from daq.drivers.aravis_device import AravisDevice
    except (ImportError, ValueError) as error:  # ValueError: gi is there, the typelib of Aravis is not
        raise DeviceUnavailable(name, f"Aravis cannot be loaded ({error}): {ARAVIS_REMEDY}") from error
    return AravisDevice


class AravisCamera:
    """Implements ``daq.devices.Camera``.

    Every call ends within seconds: Aravis gives up on a register after 2.5 s, ``collect`` has its own deadline,
    ``ask`` takes 1 s and ``disarm`` 2 s at most. A camera that was lost is opened anew by ``recover``, or the next
    ``arm``.
    Any thread may ask for counters and pictures, and disarm, while another one arms and collects.

    Parameters
    ----------
    name : str
        Name in the rig configuration.
    ip : str
        Address of the camera.
    profile : CameraProfile
        What it is told before each run, and its timing.
    shape : tuple[int, int]
        (rows, columns) of one exposure.
    network : Network
        How its images are sent, and what may wait for them.
    """

    def __init__(self, name: str, ip: str, profile: CameraProfile, shape: tuple[int, int], network: Network) -> None:
        self._name = name
        self._ip = ip
        self._profile = profile
        self._network = network
        self._form = ExposureFormat(shape, profile.bits, profile.frames_per_trigger, profile.pair, profile.stacked)
        self._is_open = False
        self._device: AravisDevice | None = None
        self._receiver: FrameReceiver | None = None
        self._controller: Controller | None = None
        self._last_id: int | None = None
        self._opened_ns: tuple[int, int] | None = None
        self._late_frames = 0
        self._letting_go = Lock()
        self._opening = Lock()

    def __enter__(self) -> Self:
        self._device = self._open()
        self._is_open = True
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.disarm()
        with self._opening:
            self._is_open = False
        self._release(keep=False)

    @property
    def name(self) -> str:
        """Name in the rig configuration."""
        return self._name

    @property
    def timing(self) -> CameraTiming:
        """Timing model of the profile."""
        return self._profile.camera_timing

    @property
    def image_shape(self) -> tuple[int, int]:
        """(rows, columns) of one exposure."""
        return self._form.shape

    @property
    def bits(self) -> int:
        """Significant bits of a grey value."""
        return self._profile.bits

    @property
    def is_lost(self) -> bool:
        """The camera does not answer us any more, as far as ``ask``, Aravis or a command has found out."""
        device = self._device
        return self._is_open and (device is None or device.is_lost)

    @property
    def has_half(self) -> bool:
        """One image of the two of a firing has come; which one it is, the other one proves."""
        receiver = self._receiver
        return receiver is not None and 0 < receiver.arrived < self._form.arrivals

    @property
    def counters(self) -> StreamCounters:
        """What the stream has done since the camera was armed."""
        receiver = self._receiver
        return StreamCounters() if receiver is None else receiver.counters

    def ask(self) -> None:
        """A sign of life, within 1 s; also while another thread works with the camera.

        Raises
        ------
        DeviceUnavailable
            There is none, or the camera has let go of us, as one does that was without power or cable for a while.
        """
        self._look()
        if self.is_lost:
            raise DeviceUnavailable(self._name, f"the camera at {self._ip} was lost; it is opened again between runs")

    def _look(self) -> None:
        """Find out whether the camera still knows us: it tells who controls it, and that was us when it was opened."""
        device, ours = self._device, self._controller
        controller = controller_of(self._name, self._ip)
        if device is None or controller == ours:
            return
        device.lose()
        if controller is not None:
            raise DeviceUnavailable(self._name, f"the camera at {self._ip} was taken over by {controller}")

    def recover(self) -> None:
        """Open a camera anew that was lost and answers again; takes long if another client holds it.

        Raises
        ------
        DeviceUnavailable
            It does not answer, or is held by another client.
        """
        if self._receiver is None and self.is_lost:
            self._connected()

    def identity(self) -> DeviceIdentity:
        """Vendor, model, serial number and firmware version, as the device answers."""
        return self._connected().identity()

    def arm(self) -> None:
        """Write the profile, start acquisition on a fresh stream, read every value back.

        Raises
        ------
        DeviceUnavailable
            The camera is gone, or held by another client.
        DeviceRefused
            A feature is unknown, out of range, or reads back differently; the camera is disarmed again.
        """
        self.disarm()
        device = self._connected()
        settings = self._profile.writes(self._form.shape, device.has)
        for setting in settings:
            device.write(setting)
        device.set_packets(self._network.packet_bytes, self._network.packet_delay_ns)
        receiver = FrameReceiver(self._name, device.open_stream(self._form, self._network.socket_buffer_bytes))
        receiver.start()
        self._receiver = receiver
        self._opened_ns = None
        self._last_id, self._late_frames = None, 0  # not every camera counts from 1: a lone first frame proves nothing
        try:
            device.start()
            for setting in settings:
                device.check(setting)
        except DeviceError:
            self.disarm()
            raise

    def begin_shot(self) -> None:
        """Re-base: only frames that the camera stamps later than now belong to the next firing.

        If its clock went back while frames of the last firing are on their way, a fresh acquisition tells them apart.
        """
        self._armed()
        clock_ns = self._connected().clock_ns()
        if self._last_id is None and self._went_back(clock_ns):
            self.arm()
            clock_ns = self._connected().clock_ns()
        self._armed().open_shot(clock_ns)
        self._opened_ns = monotonic_ns(), clock_ns

    def _went_back(self, clock_ns: int) -> bool:
        then_ns, told_ns = self._opened_ns or (monotonic_ns(), clock_ns)
        return clock_ns - told_ns < monotonic_ns() - then_ns - _CLOCK_LAG_NS

    def collect(self, deadline_s: float) -> DoubleFrame:
        """Exposures A and B of the firing since ``begin_shot``.

        Returns
        -------
        DoubleFrame
            A missing, incomplete or unproven exposure is black and flagged.

        Raises
        ------
        DeviceUnavailable
            An exposure is missing and the camera no longer answers.
        DeviceRefused
            It was disarmed meanwhile.
        """
        receiver = self._armed()
        arrivals = receiver.take(self._form.arrivals, deadline_s)
        if receiver is not self._receiver:
            raise DeviceRefused(self._name, "the camera was disarmed while its frames were awaited")
        shot = double_frame(arrivals, self._last_id, self._form)
        late_frames, self._late_frames = self._late_frames, receiver.counters.stale_frames
        shot = replace(shot, late_frames=self._late_frames - late_frames)
        self._last_id = arrivals[-1].frame_id if shot.valid else None
        if not shot.valid:
            self._connected().require_answer()
        return shot

    def disarm(self) -> None:
        """Stop acquisition, within 2 s; a camera that does not answer is let go, and ``arm`` opens it anew."""
        receiver = self._receiver
        if receiver is not None:
            self._release(keep=True)

    def _connected(self) -> "AravisDevice":
        with self._opening:
            if not self._is_open:
                raise DeviceRefused(self._name, "the camera is not open")
            if self._receiver is None and self._device is not None:
                self._look()  # Aravis asks a silent camera for 2.5 s, and one that was without power refuses everything
            device = self._device
            if device is None or (device.is_lost and self._receiver is None):
                device = self._device = self._open(device)
            return device

    def _open(self, lost: "AravisDevice | None" = None) -> "AravisDevice":
        """Let go of the lost one first: its heartbeat may still hold the camera."""
        aravis = load_aravis(self._name)
        controller_of(self._name, self._ip)  # Aravis takes 2.5 s to find out that nobody is there
        if lost is not None:
            lost.close()
        device = aravis(self._name, self._ip)
        self._controller = controller_of(self._name, self._ip)
        return device

    def _armed(self) -> FrameReceiver:
        receiver = self._receiver
        if receiver is None:
            raise DeviceRefused(self._name, "the camera is not armed")
        return receiver

    def _release(self, *, keep: bool) -> None:
        """Aravis asks a silent camera again and again, for up to ten seconds: the rig does not wait for that."""
        with self._letting_go:
            device, receiver, self._receiver = self._device, self._receiver, None
        if device is None:
            return
        release = Thread(target=_release, args=(device, receiver, keep), name=f"{self._name} release", daemon=True)
        release.start()
        release.join(0.0 if device.is_lost else _RELEASE_LIMIT_S)
        if release.is_alive() or device.is_lost or not keep:
            self._device = None


def _release(device: "AravisDevice", receiver: FrameReceiver | None, keep: bool) -> None:
    if receiver is not None:
        try:
            device.stop()
        except DeviceError as error:
            _log.warning("%s, while it was disarmed", error)
        receiver.stop()
    if device.is_lost or not keep:
        device.close()
