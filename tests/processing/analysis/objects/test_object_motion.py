"""Objects move as far as they are told to, as surely as is told; and where that is not known, the reason is told."""

import numpy as np
import pytest

from processing.analysis.objects.object_motion import (
    CHANGED,
    DISAGREE,
    GOES_BEYOND,
    NOT_UNIQUE,
    ObjectMotions,
    object_motions,
)
from processing.geometry import FloatArray
from tests.support.moving_objects import PITCH_MM, Body, TwoExposures, exposures, hull_of_body, thread

MOVED_MM = PITCH_MM * np.array([9.0, 7.0, 3.0])


def motions(seen: TwoExposures, bodies: list[Body]) -> ObjectMotions:
    return object_motions(seen.before, seen.after, seen.cameras, [hull_of_body(body) for body in bodies])


def threads(rng: np.random.Generator) -> list[Body]:
    """Nine that stand apart in all views, each with a displacement of its own."""
    places_mm = [np.array([x, y, 0.0]) + rng.uniform(-0.1, 0.1, 3) for x in (-1.4, 0, 1.4) for y in (-1, 0, 1)]
    return [
        thread(place_mm, rng.normal(size=3), rng.uniform(0.35, 0.7), MOVED_MM + rng.normal(0, 2 * PITCH_MM, 3))
        for place_mm in places_mm
    ]


def droplets(count: int, rng: np.random.Generator) -> list[Body]:
    return [
        Body(rng.uniform(-1.5, 1.5, (1, 3)), rng.lognormal(np.log(0.02), 0.4), MOVED_MM + rng.normal(0, PITCH_MM, 3))
        for _ in range(count)
    ]


def test_threads_among_droplets_move_as_far_as_is_told() -> None:
    errors: list[FloatArray] = []
    scores: list[FloatArray] = []
    for seed in range(3):
        rng = np.random.default_rng(seed)
        bodies = threads(rng)
        found = motions(exposures([*bodies, *droplets(90, rng)], rng), bodies)
        known = found.reasons == ""
        assert np.count_nonzero(known) >= 8
        off_mm = (found.moved_mm - [body.moved_mm for body in bodies])[known]
        errors.extend(off_mm / PITCH_MM)
        scores.extend(off_mm / np.sqrt(np.einsum("nii->ni", found.covariance_mm2[known])))
    assert np.sqrt(np.mean(np.square(errors))) < 0.06
    assert 0.6 < np.median(np.abs(scores)) / 0.6745 < 1.4


def test_among_many_droplets_wrong_motions_are_not_told() -> None:
    errors, scores, told = [], [], []
    for seed in range(203, 209):
        rng = np.random.default_rng(seed)
        bodies = threads(rng)
        found = motions(exposures([*bodies, *droplets(430, rng)], rng), bodies)
        known = found.reasons == ""
        off_mm = (found.moved_mm - [body.moved_mm for body in bodies])[known]
        errors.extend(np.linalg.norm(off_mm, axis=1) / PITCH_MM)
        scores.extend((off_mm / np.sqrt(np.einsum("nii->ni", found.covariance_mm2[known]))).ravel())
        told.extend(found.reasons.tolist())
    assert DISAGREE in told
    assert told.count("") > 0.6 * len(told)
    assert max(errors) < 0.25
    assert 0.7 < np.std(scores) < 1.4


def test_backwards_the_motion_is_the_opposite() -> None:
    rng = np.random.default_rng(5)
    bodies = threads(rng)
    seen = exposures(bodies, rng)
    there = [Body(body.balls_mm + body.moved_mm, body.radius_mm, -body.moved_mm) for body in bodies]
    back = motions(TwoExposures(seen.after, seen.before, seen.cameras), there)
    np.testing.assert_allclose(back.moved_mm, -motions(seen, bodies).moved_mm, atol=0.05 * PITCH_MM)


@pytest.mark.parametrize(
    ("moved_mm", "reason"),
    [
        (np.array([0.9, 0.0, 0.0]), CHANGED),  # farther than is looked for
        (np.array([0.0, 9.0, 0.0]), CHANGED),  # out of the images
    ],
)
def test_what_is_not_there_any_more_has_no_motion(moved_mm: FloatArray, reason: str) -> None:
    body = thread(np.zeros(3), np.array([1.0, 0.6, 0.3]), 0.5, moved_mm)
    found = motions(exposures([body], np.random.default_rng(6)), [body])
    assert found.reasons.tolist() == [reason]
    assert np.isnan(found.moved_mm).all()
    assert np.isnan(found.covariance_mm2).all()


def test_one_that_is_seen_by_less_than_three_views_has_no_motion() -> None:
    body = thread(np.array([3.3, 0.0, 3.0]), np.array([0.0, 1.0, 0.0]), 0.5, MOVED_MM)
    found = motions(exposures([body], np.random.default_rng(7)), [body])
    assert found.reasons.tolist() == [GOES_BEYOND]


def test_of_equal_threads_in_a_row_nobody_knows_which_is_which() -> None:
    row = [
        thread(np.array([0.0, 0.16 * number - 0.48, 0.0]), np.array([1.0, 0.0, 0.2]), 0.5, np.array([0.0, 0.16, 0.0]))
        for number in range(7)
    ]
    found = motions(exposures(row, np.random.default_rng(8)), row)
    assert NOT_UNIQUE in found.reasons[1:-1].tolist()
    assert not np.any((found.reasons == "")[1:-1])


def test_of_no_objects_there_are_no_motions() -> None:
    seen = exposures([thread(np.zeros(3), np.ones(3), 0.5, MOVED_MM)], np.random.default_rng(9))
    found = motions(seen, [])
    assert (found.moved_mm.shape, found.covariance_mm2.shape, len(found.reasons)) == ((0, 3), (0, 3, 3), 0)
