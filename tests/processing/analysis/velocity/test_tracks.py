"""Tracks of droplets that are known, with what is missed and what is invented; and motion along them."""

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

from processing.analysis.velocity.moving_droplets import MovingDroplets
from processing.analysis.velocity.partners import Candidates, assigned
from processing.analysis.velocity.track_motion import track_points
from processing.analysis.velocity.tracks import link
from processing.geometry import FloatArray
from processing.studies.velocity.track_truth import whole_and_right
from tests.support.droplet_series import Series, series

OTHERS = 10_000_000
"""Added to the label of a droplet: that of the one beside it."""


@pytest.mark.parametrize(
    ("scene", "least_whole"),
    [
        ({}, 0.99),
        ({"density_per_mm3": 4.0}, 0.97),
        ({"step": (9.0, 7.0, 3.0), "scatter": 0.3, "frames": 8}, 0.99),
        ({"found": 0.93, "ghosts": 0.05}, 0.98),
    ],
)
def test_tracks_are_whole_and_right(scene: dict[str, float], least_whole: float) -> None:
    shown = series(**scene)  # type: ignore[arg-type]
    whole, right = whole_and_right(link(shown.frames).ids, shown.labels)
    assert whole >= least_whole
    assert right >= 0.995


def test_a_track_goes_on_beyond_frames_without_its_droplet() -> None:
    shown = series(found=1.0, ghosts=0.0)
    hidden = [
        frame.where(np.flatnonzero((label % 3 != 0) | (number not in (5, 6))))
        for number, (frame, label) in enumerate(zip(shown.frames, shown.labels, strict=True))
    ]
    labels = [label[(label % 3 != 0) | (number not in (5, 6))] for number, label in enumerate(shown.labels)]
    whole, right = whole_and_right(link(hidden).ids, labels)
    assert whole > 0.98
    assert right > 0.99


def test_tracks_of_droplets_side_by_side_are_whole() -> None:
    """Either one of two could be either track: together they are assigned, one by one neither is sure enough."""
    shown = doubled(series(5, 14.0, frames=20))
    whole, right = whole_and_right(link(shown.frames).ids, shown.labels)
    assert whole > 0.97
    assert right > 0.99


def doubled(shown: Series) -> Series:
    """Each droplet with another one beside it, 1.5 voxels off, that is alike and flies along."""
    rng, frames, labels = np.random.default_rng(5), [], []
    beside: dict[int, FloatArray] = {}
    for frame, label in zip(shown.frames, shown.labels, strict=True):
        true = np.flatnonzero(label >= 0)
        away = np.array([beside.setdefault(one, rng.normal(0, 0.9, 3)) for one in label[true].tolist()])
        places = frame.places[true] + away + rng.normal(0, 0.05, away.shape)
        looks = frame.log_sizes[true] + rng.normal(0, 0.05, len(true))
        both = (np.vstack([frame.places, places]), np.concatenate([frame.covariance, frame.covariance[true]]))
        frames.append(MovingDroplets(*both, np.append(frame.log_sizes, looks)))
        labels.append(np.append(label, OTHERS + label[true]))
    return Series(frames, labels, shown.velocities, shown.accelerations)


def test_droplets_are_assigned_as_scipy_does_with_all_costs_at_hand() -> None:
    rng = np.random.default_rng(3)
    for firsts, seconds in [(6, 9), (9, 6), (7, 7), (1, 1), (4, 0), (0, 4)]:
        own, other = np.nonzero(rng.random((firsts, seconds)) < 0.5)
        odds = rng.lognormal(0, 2, len(own))
        chosen = assigned(Candidates(own, other, np.zeros((len(own), 3))), odds, firsts, seconds)
        costs = np.zeros((firsts, seconds))
        costs[own, other] = np.minimum(-np.log(odds), 0)
        assert -np.log(odds[chosen]).sum() == pytest.approx(costs[linear_sum_assignment(costs)].sum())
        assert len(np.unique(own[chosen])) == len(np.unique(other[chosen])) == len(chosen)


def test_ghosts_make_no_tracks() -> None:
    shown = series(ghosts=0.1)
    tracks = link(shown.frames)
    of_ghosts = np.concatenate([ids[label < 0] for ids, label in zip(tracks.ids, shown.labels, strict=True)])
    assert len(of_ghosts) > 200
    assert np.mean(of_ghosts >= 0) < 0.01


def test_ids_count_from_zero_and_links_have_probabilities() -> None:
    tracks = link(series(frames=6).frames)
    every = np.concatenate(tracks.ids)
    np.testing.assert_array_equal(np.unique(every[every >= 0]), np.arange(tracks.count))
    begun: set[int] = set()
    for ids, p_link in zip(tracks.ids, tracks.p_link, strict=True):
        for track, p in zip(ids.tolist(), p_link.tolist(), strict=True):
            assert np.isnan(p) == (track < 0 or track not in begun)
            begun.add(track)
        chosen = ids[ids >= 0]
        assert len(np.unique(chosen)) == len(chosen)


def test_mirrored_series_have_the_same_tracks() -> None:
    shown = series(frames=6)
    mirrored = [MovingDroplets(one.places * (-1, 1, -1), one.covariance, one.log_sizes) for one in shown.frames]
    for plain, other in zip(link(shown.frames).ids, link(mirrored).ids, strict=True):
        np.testing.assert_array_equal(plain, other)


@pytest.mark.parametrize("step", [(4.0, 3.0, 1.5), (0.5, 0.2, 0.1)])
def test_frames_of_different_sprays_have_no_tracks(step: tuple[float, float, float]) -> None:
    tracks = link([series(seed, frames=1, step=step).frames[0] for seed in range(8)])
    assert sum(np.count_nonzero(ids >= 0) for ids in tracks.ids) <= 0.005 * sum(len(ids) for ids in tracks.ids)


def test_a_series_that_begins_with_empty_frames_is_tracked() -> None:
    shown = series(frames=6)
    nothing = shown.frames[0].where(np.zeros(0, np.intp))
    tracks = link([nothing, nothing, *shown.frames])
    whole, _ = whole_and_right(tracks.ids[2:], shown.labels)
    assert whole > 0.98


def test_tracks_go_on_beyond_an_empty_frame() -> None:
    shown = series(frames=9, ghosts=0.0, turn=0.01)
    frames = list(shown.frames)
    frames[4] = frames[4].where(np.zeros(0, np.intp))
    labels = [*shown.labels[:4], shown.labels[4][:0], *shown.labels[5:]]
    whole, right = whole_and_right(link(frames).ids, labels)
    assert whole > 0.97
    assert right > 0.995


@pytest.mark.parametrize("count", [0, 1, 2])
def test_few_frames_are_no_tracks(count: int) -> None:
    tracks = link(series(frames=2).frames[:count])
    assert (len(tracks.ids), tracks.count) == (count, 0)
    assert not len(track_points(series(frames=2).frames[:count], tracks).track)


def motion_errors(shown: Series, frames: list[MovingDroplets]) -> tuple[np.ndarray, np.ndarray]:
    """Errors of velocities and accelerations over their standard deviations."""
    points = track_points(frames, link(frames))
    label = np.array([shown.labels[frame][row] for frame, row in zip(points.frame, points.row, strict=True)])
    true = np.array([shown.velocities[frame][one] for frame, one in zip(points.frame, label, strict=True)])
    known = (label >= 0) & np.isfinite(points.velocities[:, 0])
    sd = np.sqrt(np.einsum("nii->ni", points.velocity_covariance))
    velocity = (points.velocities - true) / sd
    acceleration = (points.accelerations - shown.accelerations[label]) / points.acceleration_sd
    return velocity[known], acceleration[known]


def test_velocities_and_accelerations_are_as_exact_as_they_say() -> None:
    shown = series(turn=0.05)
    for scores in motion_errors(shown, shown.frames):
        assert np.median(np.abs(scores)) / 0.6745 == pytest.approx(1, abs=0.1)
        assert np.abs(np.mean(scores)) < 0.1


def test_where_two_droplets_of_a_track_are_near_there_is_no_motion() -> None:
    frames = series(frames=6, noise=0.01).frames
    nothing = frames[0].where(np.zeros(0, np.intp))
    gappy = [frames[0], frames[1], nothing, nothing, frames[4], frames[5]]
    points = track_points(gappy, link(gappy), half_window=2)
    assert len(points.track) > 100
    alone = (points.frame == 0) | (points.frame == 5)
    assert np.isnan(points.velocities[alone]).all()
    assert np.isnan(points.acceleration_sd[alone]).all()
    assert np.isfinite(points.places).all()


def test_droplets_without_any_noise_have_motion() -> None:
    exact = series(frames=5, noise=0.0, turn=0.0).frames
    points = track_points(exact, link(exact))
    assert np.nanmax(np.abs(points.accelerations)) < 1e-3


def test_a_longer_window_is_surer() -> None:
    frames = series(frames=9).frames
    tracks = link(frames)
    short, long = (track_points(frames, tracks, half_window) for half_window in (1, 3))
    assert np.nanmedian(long.acceleration_sd) < 0.3 * np.nanmedian(short.acceleration_sd)
