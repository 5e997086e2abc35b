"""What every Camera does, run on the Aravis driver with the simulated GigE Vision camera behind it."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from time import monotonic

import numpy as np
import pytest

from daq.devices import Camera
from daq.drivers.aravis_camera import AravisCamera
from daq.drivers.camera_profile import FeatureWrite, load_camera_profile
from daq.errors import DeviceError
from daq.shot import DoubleFrame, FiredTrain, Image, LightPulse
from daq.simulation.camera.gige_camera import SimulatedCamera
from daq.simulation.camera.light import Exposure

pytestmark = pytest.mark.network

VIEW, SHAPE = "view2", (96, 160)
PROFILE = load_camera_profile(Path(__file__).parents[2] / "configs" / "cameras" / "simulated.toml")
STACKED = {
    "features": (*PROFILE.features[:-1], FeatureWrite(feature="ExposureMode", value="StackedDoubleFrame")),
    "pair": None,
    "stacked": True,
}
"""Both exposures in one image, one above the other."""
FORMATS = ("Mono8", "Mono10", "Mono12", "Mono14", "Mono16")
FRAME_MARK = {"A": 1, "B": 2}


@dataclass(frozen=True)
class CameraBench:
    """A camera, and hands that fire light into it."""

    camera: Camera
    fire: Callable[[], int]
    lose_exposure_b: Callable[[], None]

    def shoot(self, deadline_s: float = 2.0) -> tuple[int, DoubleFrame]:
        self.camera.begin_shot()
        sequence = self.fire()
        return sequence, self.camera.collect(deadline_s)


def signed(exposure: Exposure) -> Image:
    """An exposure that says when and what it is in its first two pixels, and is as bright as its light."""
    image = np.full(exposure.shape, 10 * len(exposure.pulses), np.uint8 if exposure.bits == 8 else np.uint16)
    image[0, :2] = exposure.sequence, FRAME_MARK[exposure.frame]
    if exposure.bits > 8:
        image[-1, -1] = 2**exposure.bits - 1
    return image


def train(sequence: int) -> FiredTrain:
    close_ns = PROFILE.camera_timing.frame_a_close_ns
    pulses = (LightPulse(close_ns - 1500, 1000, 10.0), LightPulse(close_ns + 1500, 1000, 10.0))
    return FiredTrain(sequence, {VIEW: 0}, {VIEW: pulses})


@pytest.fixture
def bench(request: pytest.FixtureRequest) -> Iterator[CameraBench]:
    profile = PROFILE.model_copy(update=getattr(request, "param", {}))
    simulated = SimulatedCamera(VIEW, "127.0.0.31", "SN31", profile.camera_timing, signed, SHAPE)
    sequences = count(1)

    def fire() -> int:
        sequence = next(sequences)
        simulated.trigger(train(sequence))
        return sequence

    def lose_exposure_b() -> None:
        simulated.faults.dropped_b = 1

    with simulated, AravisCamera(VIEW, "127.0.0.31", profile, SHAPE) as camera:
        yield CameraBench(camera, fire, lose_exposure_b)


def test_names_itself(bench: CameraBench) -> None:
    assert bench.camera.name == VIEW
    identity = bench.camera.identity()
    assert (identity.vendor, identity.serial) == ("tomoshadow", "SN31")
    assert identity.model
    assert identity.firmware


def test_tells_the_timing_of_its_profile(bench: CameraBench) -> None:
    assert bench.camera.timing == PROFILE.camera_timing


@pytest.mark.parametrize(
    "bench",
    [*({"pixel_format": name} for name in FORMATS), STACKED],
    ids=[*FORMATS, "stacked"],
    indirect=True,
)
def test_delivers_both_exposures_of_a_firing_in_their_places(bench: CameraBench) -> None:
    bench.camera.arm()
    sequence, shot = bench.shoot()
    assert shot.valid
    assert shot.frame_b is not None
    for image, mark in ((shot.frame_a, 1), (shot.frame_b, 2)):
        assert image.shape == bench.camera.image_shape == SHAPE
        assert image.dtype == (np.uint8 if bench.camera.bits == 8 else np.uint16)
        assert image[0, :2].tolist() == [sequence, mark]
        assert image[1, 1] == 10
    assert bench.camera.bits == 8 or int(shot.frame_a.max()) == 2**bench.camera.bits - 1


def test_each_shot_brings_its_own_firing(bench: CameraBench) -> None:
    bench.camera.arm()
    for _ in range(3):
        sequence, shot = bench.shoot()
        assert shot.valid
        assert shot.frame_a[0, 0] == sequence


def test_images_of_a_shot_stay_as_they_are(bench: CameraBench) -> None:
    bench.camera.arm()
    _, first = bench.shoot()
    kept = first.frame_a.copy()
    for _ in range(9):
        assert bench.shoot()[1].valid
    np.testing.assert_array_equal(first.frame_a, kept)


def test_a_missing_exposure_keeps_its_slot(bench: CameraBench) -> None:
    bench.camera.arm()
    bench.lose_exposure_b()
    sequence, shot = bench.shoot(1.0)
    assert not shot.valid
    assert shot.record_a.valid
    assert shot.frame_a[0, 0] == sequence
    assert not shot.record_b.valid
    assert shot.frame_b is not None
    assert shot.frame_b.shape == SHAPE
    assert not shot.frame_b.any()


def test_collects_until_the_deadline_and_no_longer(bench: CameraBench) -> None:
    bench.camera.arm()
    bench.camera.begin_shot()
    began_s = monotonic()
    shot = bench.camera.collect(0.2)
    assert 0.2 <= monotonic() - began_s < 0.5
    assert not shot.record_a.valid
    assert not shot.record_b.valid


@pytest.mark.parametrize("bench", [{}, STACKED], ids=["two images", "stacked"], indirect=True)
def test_shows_the_newest_exposure(bench: CameraBench) -> None:
    assert bench.camera.latest() is None
    bench.camera.arm()
    sequence, _ = bench.shoot()
    newest = bench.camera.latest()
    assert newest is not None
    assert newest[0, :2].tolist() == [sequence, 2]


def test_disarms_in_any_state_and_arms_again(bench: CameraBench) -> None:
    bench.camera.disarm()
    for _ in range(2):
        bench.camera.arm()
        bench.camera.arm()
        assert bench.shoot()[1].valid
        bench.camera.disarm()
        bench.camera.disarm()


def test_is_deaf_while_disarmed(bench: CameraBench) -> None:
    bench.camera.arm()
    bench.camera.disarm()
    bench.fire()
    bench.camera.arm()
    assert not bench.camera.collect(0.15).valid


@pytest.mark.parametrize("call", [lambda camera: camera.begin_shot(), lambda camera: camera.collect(0.1)])
def test_refuses_shots_while_disarmed(bench: CameraBench, call: Callable[[Camera], object]) -> None:
    with pytest.raises(DeviceError, match=f"{VIEW}: the camera is not armed"):
        call(bench.camera)
