"""What every Camera does, run on the Aravis driver with a simulated GigE Vision camera behind it, and in memory."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np
import pytest

from daq.devices import Camera
from daq.drivers.aravis_camera import AravisCamera
from daq.drivers.camera_profile import FeatureWrite, load_camera_profile
from daq.errors import DeviceError
from daq.files.run_directory import ViewFormat
from daq.network import Network
from daq.shot import DoubleFrame, FiredTrain, Image, LightPulse
from daq.simulation.camera.gige_camera import SimulatedCamera
from daq.simulation.camera.light import Exposure
from tests.support.memory_devices import MemoryCamera
from tests.support.server_process import eventually

pytestmark = pytest.mark.network

VIEW, SHAPE = "view2", (96, 160)
PROFILE = load_camera_profile(Path(__file__).parents[2] / "configs" / "cameras" / "simulated.toml")
BITS = (8, 10, 12, 14, 16)
FRAME_MARK = {"A": 1, "B": 2}


@dataclass
class CameraStand:
    """A camera, and hands that fire light into it."""

    camera: Camera
    serial: str
    trigger: Callable[[FiredTrain], None]
    lose_exposure_b_of: Callable[[int], None]
    fired: int = 0

    def fire(self) -> int:
        self.fired += 1
        self.trigger(train(self.fired))
        return self.fired

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


@contextmanager
def driven(**changes: Any) -> Iterator[CameraStand]:
    """The driver, with some values of its profile changed."""
    profile = PROFILE.model_copy(update=changes)
    simulated = SimulatedCamera(VIEW, "127.0.0.31", "SN31", profile.camera_timing, signed, SHAPE)

    def lose_next_b(_: int) -> None:
        simulated.faults.dropped_b = 1

    with simulated, AravisCamera(VIEW, "127.0.0.31", profile, SHAPE, Network()) as camera:
        yield CameraStand(camera, "SN31", simulated.trigger, lose_next_b)


@contextmanager
def stacked() -> Iterator[CameraStand]:
    """The driver of a camera with both exposures in one image, one above the other."""
    stacking = FeatureWrite(feature="ExposureMode", value="StackedDoubleFrame")
    with driven(features=(*PROFILE.features[:-1], stacking), pair=None, stacked=True) as stand:
        yield stand


@contextmanager
def in_memory(bits: int = 8) -> Iterator[CameraStand]:
    """The camera of the tests of runs."""
    with MemoryCamera(VIEW, [], signed, ViewFormat(SHAPE, bits), PROFILE.camera_timing) as camera:
        yield CameraStand(camera, VIEW, camera.trigger, camera.lost.add)


Opening = Callable[..., AbstractContextManager[CameraStand]]
WITH_TWO_IMAGES: tuple[Opening, ...] = (driven, in_memory)


@pytest.fixture(params=WITH_TWO_IMAGES)
def stand(request: pytest.FixtureRequest) -> Iterator[CameraStand]:
    with request.param() as stand:
        yield stand


def test_names_itself(stand: CameraStand) -> None:
    assert stand.camera.name == VIEW
    identity = stand.camera.identity()
    assert (identity.vendor, identity.serial) == ("tomoshadow", stand.serial)
    assert identity.model
    assert identity.firmware


def test_tells_the_timing_of_its_profile(stand: CameraStand) -> None:
    assert stand.camera.timing == PROFILE.camera_timing


@pytest.mark.parametrize(
    "stand",
    [
        *(pytest.param(partial(driven, pixel_format=f"Mono{bits}"), id=f"Mono{bits}") for bits in BITS),
        *(pytest.param(partial(in_memory, bits), id=f"in memory, {bits} bit") for bits in BITS),
        stacked,
    ],
    indirect=True,
)
def test_delivers_both_exposures_of_a_firing_in_their_places(stand: CameraStand) -> None:
    stand.camera.arm()
    sequence, shot = stand.shoot()
    assert shot.valid
    assert shot.frame_b is not None
    for image, mark in ((shot.frame_a, 1), (shot.frame_b, 2)):
        assert image.shape == stand.camera.image_shape == SHAPE
        assert image.dtype == (np.uint8 if stand.camera.bits == 8 else np.uint16)
        assert image[0, :2].tolist() == [sequence, mark]
        assert image[1, 1] == 10
    assert stand.camera.bits == 8 or int(shot.frame_a.max()) == 2**stand.camera.bits - 1


def test_each_shot_brings_its_own_firing(stand: CameraStand) -> None:
    stand.camera.arm()
    for _ in range(3):
        sequence, shot = stand.shoot()
        assert shot.valid
        assert shot.frame_a[0, 0] == sequence


def test_images_of_a_shot_stay_as_they_are(stand: CameraStand) -> None:
    stand.camera.arm()
    _, first = stand.shoot()
    kept = first.frame_a.copy()
    for _ in range(9):
        assert stand.shoot()[1].valid
    np.testing.assert_array_equal(first.frame_a, kept)


def test_a_missing_exposure_keeps_its_slot(stand: CameraStand) -> None:
    stand.camera.arm()
    assert stand.shoot(1.0)[1].valid
    stand.lose_exposure_b_of(2)
    sequence, shot = stand.shoot(1.0)
    assert not shot.valid
    assert shot.record_a.valid
    assert shot.frame_a[0, 0] == sequence
    assert not shot.record_b.valid
    assert shot.frame_b is not None
    assert shot.frame_b.shape == SHAPE
    assert not shot.frame_b.any()


def test_it_is_known_that_one_of_two_images_has_come() -> None:
    with driven() as stand:
        stand.camera.arm()
        stand.lose_exposure_b_of(1)
        stand.camera.begin_shot()
        assert not stand.camera.has_half
        stand.fire()
        eventually(lambda: stand.camera.has_half, "the first one comes")
        assert not stand.camera.collect(0.1).valid
        assert not stand.camera.has_half
        assert stand.shoot()[1].valid
        assert not stand.camera.has_half


def test_collects_until_the_deadline_and_no_longer(stand: CameraStand) -> None:
    stand.camera.arm()
    stand.camera.begin_shot()
    began_s = monotonic()
    shot = stand.camera.collect(0.2)
    assert 0.2 <= monotonic() - began_s < 0.5
    assert not shot.record_a.valid
    assert not shot.record_b.valid


def test_disarms_in_any_state_and_arms_again(stand: CameraStand) -> None:
    stand.camera.disarm()
    for _ in range(2):
        stand.camera.arm()
        stand.camera.arm()
        assert stand.shoot()[1].valid
        stand.camera.disarm()
        stand.camera.disarm()


def test_is_deaf_while_disarmed(stand: CameraStand) -> None:
    stand.camera.arm()
    stand.camera.disarm()
    stand.fire()
    stand.camera.arm()
    assert not stand.camera.collect(0.15).valid


@pytest.mark.parametrize("call", [lambda camera: camera.begin_shot(), lambda camera: camera.collect(0.1)])
def test_refuses_shots_while_disarmed(stand: CameraStand, call: Callable[[Camera], object]) -> None:
    with pytest.raises(DeviceError, match=f"{VIEW}: the camera is not armed"):
        call(stand.camera)


def test_gives_a_sign_of_life_whatever_it_is_doing(stand: CameraStand) -> None:
    stand.camera.ask()
    stand.camera.arm()
    stand.camera.begin_shot()
    stand.camera.ask()
    stand.fire()
    stand.camera.ask()
    assert stand.camera.collect(2.0).valid
    stand.camera.disarm()
    stand.camera.ask()
    assert not stand.camera.is_lost


def test_one_that_was_not_lost_is_not_opened_again(stand: CameraStand) -> None:
    stand.camera.recover()
    stand.camera.arm()
    stand.camera.recover()
    assert stand.shoot()[1].valid
