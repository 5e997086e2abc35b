"""Which half window is proposed for the filter of tracks, on flights whose noise and motion are known."""

from dataclasses import dataclass

import numpy as np
import pytest

from processing.analysis.velocity.moving_droplets import MovingDroplets
from processing.analysis.velocity.noise_curve import NoiseCurve, noise_curve
from processing.analysis.velocity.track_motion import track_points
from processing.analysis.velocity.tracks import Tracks, link
from processing.geometry import FloatArray
from tests.support.droplet_series import series

NOISE = np.array([0.03, 0.03, 0.06])
PITCH_MM, RATE_HZ = 1 / 60, 20_000.0
M_S = PITCH_MM * 1e-3 * RATE_HZ
FRAMES = 20


@dataclass(frozen=True, eq=False)
class Flight:
    """Frames, their tracks, and true motion (frame, droplet, component) in voxels and frames."""

    frames: list[MovingDroplets]
    tracks: Tracks
    velocities: FloatArray
    accelerations: FloatArray

    def curve(self) -> NoiseCurve:
        curve = noise_curve(self.frames, self.tracks, PITCH_MM, RATE_HZ)
        assert curve is not None
        return curve

    def true_errors(self, half_window: int) -> tuple[float, float]:
        """Of velocity and acceleration, where a droplet has one before and one after."""
        points = track_points(self.frames, self.tracks, half_window)
        inner = (points.frame > 0) & (points.frame < len(self.frames) - 1)
        at = points.frame[inner], points.track[inner]
        velocity = points.velocities[inner] - self.velocities[at]
        acceleration = points.accelerations[inner] - self.accelerations[at]
        return float(np.sqrt(np.mean(velocity**2))), float(np.sqrt(np.mean(acceleration**2)))


def flight(swing: float = 0.0, turn: float = 0.0, steady: float = 0.0, droplets: int = 120, hidden: int = 0) -> Flight:
    """Droplets with one steady acceleration that also swing by so many voxels, turning by so many radians per frame.

    The last ones are hidden: twenty times less is known of where they are.
    """
    rng = np.random.default_rng(1)
    noise = np.outer(np.where(np.arange(droplets) < droplets - hidden, 1, 20), NOISE)
    when = np.arange(FRAMES)[:, None, None]
    begun, phase = rng.uniform(0, 200, (droplets, 3)), turn * when + rng.uniform(0, 2 * np.pi, (droplets, 3))
    places = begun + 4.0 * when + steady * when**2 / 2 + swing * np.sin(phase)
    seen = places + rng.normal(0, noise, places.shape)
    covariance = noise[:, :, None] ** 2 * np.eye(3)
    return Flight(
        [MovingDroplets(one, covariance, np.zeros(droplets)) for one in seen],
        Tracks((np.arange(droplets),) * FRAMES, (np.ones(droplets),) * FRAMES, droplets),
        4.0 + steady * when + swing * turn * np.cos(phase),
        steady - swing * turn**2 * np.sin(phase),
    )


def test_what_noise_alone_gives_is_what_is_seen_of_droplets_that_accelerate_alike() -> None:
    curve = flight(steady=0.1).curve()
    assert curve.half_windows.tolist() == list(range(1, 10))
    np.testing.assert_allclose(curve.acceleration_m_s2, curve.acceleration_noise_m_s2, rtol=0.1)
    np.testing.assert_allclose(curve.residual_um[1:], curve.residual_noise_um[1:], rtol=0.1)
    assert curve.acceleration_noise_m_s2[0] == pytest.approx(np.sqrt(6 * np.mean(NOISE**2)) * M_S * RATE_HZ, rel=0.01)
    assert curve.velocity_noise_m_s[0] == pytest.approx(np.sqrt(np.mean(NOISE**2) / 2) * M_S, rel=0.01)
    assert curve.residual_um[-1] == pytest.approx(np.sqrt(np.mean(NOISE**2)) * PITCH_MM * 1e3, rel=0.1)


@pytest.mark.parametrize(("swing", "turn"), [(0.0, 0.0), (3.0, 0.15), (1.0, 0.3), (1.0, 0.5), (0.1, 1.0)])
def test_the_half_windows_of_least_error_are_proposed(swing: float, turn: float) -> None:
    flown = flight(swing, turn, steady=0.05)
    curve = flown.curve()
    least = 1 + np.argmin([flown.true_errors(int(half_window)) for half_window in curve.half_windows], axis=0)
    assert abs(curve.for_velocity - least[0]) <= 1
    assert abs(curve.for_acceleration - least[1]) <= 1


def test_a_wide_window_shows_less_motion_than_there_is_and_leaves_it_in_the_residuals() -> None:
    flown = flight(1.0, 0.5)
    curve = flown.curve()
    assert curve.acceleration_m_s2[-1] < 0.5 * np.std(flown.accelerations) * M_S * RATE_HZ
    assert curve.residual_um[-1] > 5 * curve.residual_noise_um[-1]


def test_velocities_as_seen_are_true_ones_and_noise() -> None:
    flown = flight(1.0, 0.3)
    curve = flown.curve()
    expected = np.hypot(np.std(flown.velocities[1:-1]) * M_S, curve.velocity_noise_m_s[0])
    assert curve.velocity_m_s[0] == pytest.approx(expected, rel=0.02)


def test_wrong_links_do_not_count() -> None:
    """Every fortieth droplet swaps with its neighbour for a frame."""
    flown = flight(1.0, 0.15)
    ids = [one.copy() for one in flown.tracks.ids]
    ids[9][::40], ids[9][1::40] = ids[9][1::40].copy(), ids[9][::40].copy()
    swapped = Flight(flown.frames, Tracks(tuple(ids), flown.tracks.p_link, flown.tracks.count), *[np.empty(0)] * 2)
    right, wrong = flown.curve(), swapped.curve()
    np.testing.assert_allclose(wrong.acceleration_m_s2, right.acceleration_m_s2, rtol=0.05)
    assert abs(wrong.for_velocity - right.for_velocity) <= 1


def test_a_few_droplets_that_are_hardly_known_do_not_decide() -> None:
    clear, dim = flight(1.0, 0.3).curve(), flight(1.0, 0.3, hidden=8).curve()
    np.testing.assert_allclose(dim.acceleration_noise_m_s2, clear.acceleration_noise_m_s2, rtol=0.1)
    np.testing.assert_allclose(dim.residual_um[1:], clear.residual_um[1:], rtol=0.1)
    assert abs(dim.for_velocity - clear.for_velocity) <= 1


def test_linked_droplets_of_a_spray_have_a_curve() -> None:
    shown = series(frames=10, turn=0.0)
    curve = noise_curve(shown.frames, link(shown.frames), PITCH_MM, RATE_HZ)
    assert curve is not None
    np.testing.assert_allclose(curve.acceleration_m_s2, curve.acceleration_noise_m_s2, rtol=0.1)
    assert curve.for_velocity >= 3


@pytest.mark.parametrize("frames", [0, 2, 3])
def test_few_points_have_no_curve(frames: int) -> None:
    few = flight(droplets=25)
    tracks = Tracks(few.tracks.ids[:frames], few.tracks.p_link[:frames], 25)
    assert noise_curve(few.frames[:frames], tracks, PITCH_MM, RATE_HZ) is None
