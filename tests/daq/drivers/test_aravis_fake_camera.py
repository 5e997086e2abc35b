"""The driver of one camera against a far end that is not ours: the fake camera that comes with Aravis.

It has no pairs, no hardware trigger and no clock that runs: what it can show is that the driver speaks GigE Vision.
"""

import subprocess
import sys
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from daq.drivers.camera_profile import FeatureWrite
from daq.drivers.exposure_pairing import Arrival, ExposureFormat
from daq.errors import DeviceError, DeviceRefused

pytestmark = pytest.mark.network
gi = pytest.importorskip("gi", reason="Aravis is not installed (apt install python3-gi gir1.2-aravis-0.8)")

IP, SERIAL = "127.0.0.1", "GV77"  # the fake camera takes the address of an interface only
SHAPE = (128, 256)
PROFILE = (
    FeatureWrite(feature="Width", value=SHAPE[1]),
    FeatureWrite(feature="Height", value=SHAPE[0]),
    FeatureWrite(feature="PixelFormat", value="Mono8"),
    FeatureWrite(feature="TriggerMode", value="Off"),
    FeatureWrite(feature="ExposureTimeAbs", value=2000.0),
    FeatureWrite(feature="AcquisitionFrameRate", value=25.0),
)
FRAMES = 4
LIMIT_S = 20.0


@pytest.fixture(scope="module")
def fake_camera() -> Iterator[None]:
    try:
        gi.require_version("Aravis", "0.8")
        from gi.repository import Aravis
    except (ImportError, ValueError) as reason:
        pytest.skip(f"Aravis cannot be loaded: {reason}")
    if not hasattr(Aravis, "GvFakeCamera"):
        pytest.skip("this Aravis comes without its fake camera")
    camera = Aravis.GvFakeCamera.new(IP, SERIAL)
    assert camera.is_running(), f"the fake camera of Aravis does not run at {IP}"
    yield
    del camera


@pytest.fixture
def device(fake_camera: None) -> Iterator[Any]:
    from daq.drivers.aravis_device import AravisDevice

    opened = AravisDevice("fake", IP)
    yield opened
    opened.close()


def test_it_says_who_it_is(device: Any) -> None:
    identity = device.identity()
    assert (identity.vendor, identity.model, identity.serial) == ("Aravis", "Fake", SERIAL)
    assert identity.firmware


def test_a_profile_is_written_and_read_back(device: Any) -> None:
    for setting in PROFILE:
        device.write(setting)
    for setting in PROFILE:
        device.check(setting)
    device.set_packets(1500, 2000)
    device.write(FeatureWrite(feature="Width", value=512))
    with pytest.raises(DeviceRefused, match="Width reads 512 after writing 256"):
        device.check(PROFILE[0])


def test_frames_come_whole_and_in_order(device: Any) -> None:
    for setting in PROFILE:
        device.write(setting)
    device.set_packets(1500, 0)
    stream = device.open_stream(ExposureFormat(SHAPE, 8, 1, None), 2**20)
    device.start()
    try:
        frames = [next_frame(stream) for _ in range(FRAMES)]
    finally:
        device.stop()
        stream.close()
    ids = [frame.frame_id for frame in frames]
    assert ids == list(range(ids[0], ids[0] + FRAMES))
    for frame in frames:
        assert frame.image is not None
        assert frame.image.shape == SHAPE
        assert len(np.unique(frame.image)) > 1


def next_frame(stream: Any) -> Arrival:
    end_s = time.monotonic() + LIMIT_S
    while (frame := stream.pop()) is None:
        assert time.monotonic() < end_s, f"no frame within {LIMIT_S} s"
    assert isinstance(frame, Arrival)
    return frame


@pytest.mark.parametrize(
    ("setting", "reason"),
    [
        (FeatureWrite(feature="ExposureMode", value="DoubleFrame"), r"ExposureMode = DoubleFrame: .*Not found"),
        (FeatureWrite(feature="Width", value=99_999), r"Width = 99999: .*greater than allowed maximum '2048'"),
        (FeatureWrite(feature="PixelFormat", value="Mono99"), "PixelFormat = Mono99: "),
    ],
    ids=["unknown", "too large", "no such choice"],
)
def test_what_it_cannot_do_is_refused_in_words(device: Any, setting: FeatureWrite, reason: str) -> None:
    with pytest.raises(DeviceRefused, match=f"fake: {reason}"):
        device.write(setting)


def test_threads_find_all_that_they_compare_with() -> None:
    """What PyGObject loads at its first use may be half there for a second thread: it is loaded with the driver."""
    pytest.importorskip("gi")
    code = "import daq.drivers.aravis_device as driver; print(*vars(driver.Aravis))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True)
    assert {"BufferStatus", "DeviceError"} <= set(done.stdout.split())


def test_nobody_answers_at_another_address(fake_camera: None) -> None:
    from daq.drivers.aravis_device import AravisDevice

    with pytest.raises(DeviceError, match=r"no camera answers at 127\.0\.0\.78"):
        AravisDevice("fake", "127.0.0.78")
