"""The simulated camera and its scene: slow scenes, foreign trains, interrupted acquisitions."""

from collections.abc import Iterator
from pathlib import Path
from threading import Event

import numpy as np
import pytest

from daq.drivers.aravis_camera import AravisCamera
from daq.drivers.camera_profile import load_camera_profile
from daq.network import Network
from daq.shot import FiredTrain, Image
from daq.simulation.camera.gige_camera import SimulatedCamera
from daq.simulation.camera.light import Exposure

pytestmark = pytest.mark.network

IP, SHAPE = "127.0.0.36", (32, 48)
PROFILE = load_camera_profile(Path(__file__).parents[3] / "configs" / "cameras" / "simulated.toml")


class SlowScene:
    """A scene that takes its time: each exposure waits until it is let through."""

    def __init__(self) -> None:
        self.asked_for: list[Exposure] = []
        self.asked = Event()
        self.done = Event()

    def __call__(self, exposure: Exposure) -> Image:
        self.asked_for.append(exposure)
        self.asked.set()
        self.done.wait(5.0)
        return np.full(exposure.shape, exposure.sequence, np.uint8)


@pytest.fixture
def scene() -> SlowScene:
    return SlowScene()


@pytest.fixture
def simulated(scene: SlowScene) -> Iterator[SimulatedCamera]:
    with SimulatedCamera("view1", IP, "SN36", PROFILE.camera_timing, scene, SHAPE) as camera:
        yield camera
        scene.done.set()


@pytest.fixture
def camera(simulated: SimulatedCamera) -> Iterator[AravisCamera]:
    with AravisCamera("view1", IP, PROFILE, SHAPE, Network()) as camera:
        camera.arm()
        yield camera


def fire(simulated: SimulatedCamera, sequence: int, view: str = "view1") -> None:
    simulated.trigger(FiredTrain(sequence, {view: 1000}))


def test_a_slow_scene_delays_the_exposures_and_loses_none(
    simulated: SimulatedCamera, camera: AravisCamera, scene: SlowScene
) -> None:
    camera.begin_shot()
    fire(simulated, 1)
    assert not camera.collect(0.2).valid
    scene.done.set()
    shot = camera.collect(2.0)
    assert shot.valid
    assert shot.frame_a[0, 0] == 1


def test_exposures_of_an_ended_acquisition_are_not_sent_into_the_next(
    simulated: SimulatedCamera, camera: AravisCamera, scene: SlowScene
) -> None:
    camera.begin_shot()
    fire(simulated, 1)
    assert scene.asked.wait(2.0)
    camera.arm()
    scene.done.set()
    assert not camera.collect(0.3).valid
    camera.begin_shot()
    fire(simulated, 2)
    shot = camera.collect(2.0)
    assert shot.valid
    assert (shot.frame_a[0, 0], shot.record_a.frame_id) == (2, 1)


def test_the_scene_is_asked_by_view_sequence_and_frame(
    simulated: SimulatedCamera, camera: AravisCamera, scene: SlowScene
) -> None:
    scene.done.set()
    camera.begin_shot()
    fire(simulated, 7)
    assert camera.collect(2.0).valid
    assert [(each.view, each.sequence, each.frame, each.shape, each.bits) for each in scene.asked_for] == [
        ("view1", 7, "A", SHAPE, 8),
        ("view1", 7, "B", SHAPE, 8),
    ]
    timing = PROFILE.camera_timing
    assert scene.asked_for[0].window.open_ns == 1000 + timing.trigger_delay_ns
    assert scene.asked_for[1].window.open_ns - scene.asked_for[0].window.close_ns == timing.gap_ns


def test_a_train_without_an_edge_for_this_camera_does_nothing(
    simulated: SimulatedCamera, camera: AravisCamera, scene: SlowScene
) -> None:
    camera.begin_shot()
    fire(simulated, 1, view="view9")
    assert not camera.collect(0.1).valid
    assert scene.asked_for == []
    assert simulated.lost_triggers == 0


def test_a_trigger_before_arming_is_lost(simulated: SimulatedCamera) -> None:
    fire(simulated, 1)
    assert simulated.lost_triggers == 1


def test_the_same_camera_can_be_switched_on_again(scene: SlowScene) -> None:
    scene.done.set()
    simulated = SimulatedCamera("view1", IP, "SN36", PROFILE.camera_timing, scene, SHAPE)
    simulated.kill()
    for _ in range(2):
        with simulated, AravisCamera("view1", IP, PROFILE, SHAPE, Network()) as camera:
            camera.arm()
            camera.begin_shot()
            fire(simulated, 1)
            assert camera.collect(2.0).valid
