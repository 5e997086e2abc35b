"""The scene before the simulated cameras: light, double exposures, dark, target, and its repeatability."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from processing.synthetic.illumination import dust_transmittance, light_field
from processing.synthetic.liquid.nozzles import flat_fan_spray
from processing.synthetic.paper_rig import paper_cameras, paper_optics
from processing.synthetic.rendering import render_transmittance
from processing.synthetic.scene import Pulse, Scene
from processing.synthetic.sensor import Sensor, camera_image
from processing.synthetic.shadow_cache import ShadowCache
from processing.synthetic.spray import Spray
from processing.synthetic.stamping import FloatArray, FloatImage

CAMERAS, OPTICS = paper_cameras(binning=4), paper_optics(binning=4)
SHAPE = (300, 400)
QUIET = Sensor(full_well_e=1e14, read_noise_e=0)
FLASH_A: Pulse = (0, 1000, 9.9)
FLASH_B: Pulse = (6400, 1000, 9.9)
DARK_LEVEL = 0.02 * 65535


def quiet_scene(seed: int = 1) -> Scene:
    return Scene(CAMERAS, OPTICS, seed=seed, sensor=QUIET)


def light(scene: Scene, kind: str, pulses: list[Pulse], view: str = "view2", sequence: int = 1) -> FloatArray:
    """Grey values above the dark level, noise-free."""
    scene.prepare(kind)
    return scene.render(view, sequence, "A", pulses, SHAPE, 16).astype(float) - DARK_LEVEL


@pytest.mark.parametrize("view", sorted(CAMERAS))
def test_nominal_current_exposes_half_of_the_dynamic_range(view: str) -> None:
    pulse = (0, 1000, OPTICS[view].nominal_current_a)
    assert light(quiet_scene(), "background", [pulse], view).mean() / 65535 == pytest.approx(0.5, abs=0.02)


def test_light_is_current_times_collected_time() -> None:
    scene = quiet_scene()
    full = light(scene, "background", [FLASH_A])
    np.testing.assert_allclose(light(scene, "background", [(0, 250, 9.9)]), 0.25 * full, atol=1.5)
    np.testing.assert_allclose(light(scene, "background", [(0, 1000, 3.3)]), full / 3, atol=1.5)
    np.testing.assert_allclose(light(scene, "background", []), 0, atol=1.1)


def test_double_exposure_is_the_sum_of_both() -> None:
    scene = quiet_scene()
    dim_a, dim_b = (0, 1000, 4.0), (6400, 1000, 4.0)
    one, two = light(scene, "sample", [dim_a]), light(scene, "sample", [dim_b])
    np.testing.assert_allclose(light(scene, "sample", [dim_a, dim_b]), one + two, atol=2)
    assert np.abs(one - two).max() > 1000


def test_sample_over_background_is_the_transmittance_of_the_spray() -> None:
    scene = quiet_scene()
    ratio = light(scene, "sample", [FLASH_B]) / light(scene, "background", [FLASH_B])
    spray = scene.truth(1, 6900)
    expected = render_transmittance(CAMERAS["view2"], spray, OPTICS["view2"], 1e-6)
    np.testing.assert_allclose(ratio, expected, atol=2e-4)


def test_truth_flies_from_one_pulse_to_the_next() -> None:
    scene = quiet_scene()
    first, second = scene.truth(3, 500), scene.truth(3, 6900)
    np.testing.assert_allclose(second.positions_mm, first.advanced(6400e-9).positions_mm, atol=1e-12)


def test_sequence_numbers_and_factories_choose_the_spray() -> None:
    scene, fan = quiet_scene(), Scene(CAMERAS, OPTICS, spray_factory=flat_fan_spray)
    assert not np.array_equal(scene.truth(1, 0).positions_mm[:9], scene.truth(2, 0).positions_mm[:9])
    assert np.abs(fan.truth(1, 0).positions_mm[:, 2]).max() < 0.5 * np.abs(scene.truth(1, 0).positions_mm[:, 2]).max()


def test_dark_is_dark_and_only_frame_b_collects_room_light() -> None:
    scene = quiet_scene()
    scene.prepare("dark")
    frame_a, frame_b = (scene.render("view1", 1, frame, [FLASH_A], SHAPE, 16) for frame in ("A", "B"))
    np.testing.assert_allclose(frame_a, DARK_LEVEL, atol=1.1)
    np.testing.assert_allclose(frame_b, DARK_LEVEL + 0.01 * 65535, atol=1.1)


def test_target_stands_where_the_stage_is() -> None:
    z_mm = [-2.0]
    scene = Scene(CAMERAS, OPTICS, sensor=QUIET, stage_z_mm=lambda: z_mm[0])
    first = light(scene, "calibration", [FLASH_A])
    z_mm[0] = 3.0
    moved = light(scene, "calibration", [FLASH_A])
    assert np.abs(first - moved).max() > 10_000
    z_mm[0] = -2.0
    np.testing.assert_allclose(light(scene, "calibration", [FLASH_A], sequence=9), first, atol=1.1)


def test_noise_belongs_to_view_sequence_and_frame() -> None:
    def images(scene: Scene) -> list[FloatArray]:
        scene.prepare("background")
        keys = [("view2", 1, "A"), ("view2", 1, "B"), ("view2", 2, "A"), ("view3", 1, "A")]
        return [
            scene.render(view, number, "B" if frame == "B" else "A", [], SHAPE, 12).astype(float)
            for view, number, frame in keys
        ]

    once, again = images(Scene(CAMERAS, OPTICS, seed=5)), images(Scene(CAMERAS, OPTICS, seed=5))
    np.testing.assert_array_equal(once, again)
    noise = np.array([image.ravel() - image.mean() for image in once])
    np.testing.assert_allclose(np.corrcoef(noise), np.eye(4), atol=0.02)


def test_threads_render_what_one_thread_renders() -> None:
    jobs = [(view, sequence) for sequence in (1, 2, 3) for view in CAMERAS]

    def render(scene: Scene, job: tuple[str, int]) -> FloatArray:
        return scene.render(job[0], job[1], "A", [FLASH_A], SHAPE, 8).astype(float)

    alone, shared = Scene(CAMERAS, OPTICS, seed=2), Scene(CAMERAS, OPTICS, seed=2)
    alone.prepare("sample")
    shared.prepare("sample")
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(lambda job: render(shared, job), reversed(jobs)))
    np.testing.assert_array_equal([render(alone, job) for job in reversed(jobs)], together)


class CountedSpray(Spray):
    """A spray that counts how often it is asked to fly: once per rendered shadow."""

    flights = 0

    def advanced(self, dt_s: float) -> Spray:
        type(self).flights += 1
        return super().advanced(dt_s)


def test_shadows_of_a_firing_are_rendered_once_and_no_image_is_changed_by_that() -> None:
    def fan(seed: Sequence[int]) -> Spray:
        return CountedSpray(**vars(flat_fan_spray(seed)))

    warm, cold = (Scene(CAMERAS, OPTICS, seed=4, spray_factory=fan) for _ in range(2))
    warm.prepare("sample")
    cold.prepare("sample")
    for view in CAMERAS:
        warm.render(view, 2, "B", [FLASH_B], SHAPE, 8)
    assert CountedSpray.flights == len(CAMERAS)
    image = warm.render("view4", 2, "B", [FLASH_B], SHAPE, 8)
    assert CountedSpray.flights == len(CAMERAS)
    np.testing.assert_array_equal(image, cold.render("view4", 2, "B", [FLASH_B], SHAPE, 8))


def test_wrong_requests_are_refused_by_name() -> None:
    scene = quiet_scene()
    with pytest.raises(ValueError, match=r"view1: the scene renders \(300, 400\) .*\(1200, 1600\)"):
        scene.render("view1", 1, "A", [], (1200, 1600), 8)
    with pytest.raises(ValueError, match="flat"):
        scene.prepare("flat")
    with pytest.raises(ValueError, match="view1"):
        Scene({"view1": CAMERAS["view1"]}, {})


def test_sensor_saturates_and_has_the_noise_of_its_electrons() -> None:
    grey = camera_image(np.full((300, 300), 0.4, np.float32), Sensor(), 12, np.random.default_rng(0))
    assert grey.dtype == np.uint16
    expected = np.hypot(np.sqrt(0.4 * 20_000), 16) / 20_000 * 4095
    assert grey.std() == pytest.approx(expected, rel=0.02)
    assert grey.mean() == pytest.approx(0.42 * 4095, rel=0.002)
    bright = camera_image(np.full((9, 9), 3.0, np.float32), Sensor(), 8, np.random.default_rng(0))
    assert bright.dtype == np.uint8
    assert bright.min() == 255


def test_light_and_dust_are_fixed_per_seed_and_differ_between_views() -> None:
    for pattern in (light_field, dust_transmittance):
        np.testing.assert_array_equal(pattern(SHAPE, [1, 2]), pattern(SHAPE, [1, 2]))
        assert np.abs(pattern(SHAPE, [1, 2]) - pattern(SHAPE, [1, 3])).max() > 0.05
    field = light_field((1200, 1600), 0)
    assert field.mean() == pytest.approx(1, abs=1e-4)
    assert 0.4 < field.min() < 0.8
    assert 1.1 < field.max() < 1.4
    assert 0.001 < (dust_transmittance((1200, 1600), 0) < 0.95).mean() < 0.05


def test_cache_keeps_the_newest_within_its_budget() -> None:
    made: list[int] = []

    def kept(number: int) -> FloatImage:
        def make() -> FloatImage:
            made.append(number)
            return np.full((10, 10), number / 8, np.float32)

        return cache.get(number, make)

    cache = ShadowCache(budget_bytes=2 * 200)
    for number in (1, 2, 1, 3, 1, 2):
        np.testing.assert_allclose(kept(number), number / 8, atol=1e-5)
    assert made == [1, 2, 3, 2]
