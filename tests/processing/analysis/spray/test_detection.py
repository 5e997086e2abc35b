"""What twins tell of droplets that are not found, against sprays of which the truth is known."""

import json

import numpy as np

from processing.analysis.droplets.droplet_file import StoredDroplets
from processing.analysis.droplets.ghost_share import found_by_class
from processing.analysis.droplets.size_statistics import class_numbers, size_classes
from processing.analysis.spray.detection import MAY_BE_FEW, NONE_PLACED, ClassDetection, detection
from processing.analysis.spray.spray_statistics import spray_statistics
from processing.geometry import FloatArray
from tests.support.sampled_sprays import stored_shot


def found_of(diameters_um: FloatArray, scale: float) -> FloatArray:
    """Probability to be found: half of the droplets of 12 um, 95 % of those of 20 um."""
    return np.asarray(1 / (1 + (12 * scale / diameters_um) ** 5.8), np.float64)


def spray(seed: int, scale: float = 1.0, twins: int = 2) -> tuple[list[StoredDroplets], FloatArray]:
    """Four shots of lognormal droplets, and all droplets that there are."""
    rng = np.random.default_rng(seed)
    truth_um = scale * 25 * np.exp(0.5 * rng.standard_normal(1600))
    is_found = rng.random(1600) < found_of(truth_um, scale)
    shots = []
    for shot in range(4):
        told_um = truth_um[shot::4][is_found[shot::4]]
        again_um = np.tile(told_um, twins)
        classes = found_by_class(again_um, rng.random(len(again_um)) < found_of(again_um, scale))
        twin = {"ghosts": 0, "found": len(again_um), "classes": [vars(one) for one in classes]}
        exposures = json.dumps({"a": {"verdict": "good", "twins": twin}})
        shots.append(stored_shot(told_um, shot=shot, exposures=exposures))
    return shots, truth_um


def detected(shots: list[StoredDroplets]) -> tuple[ClassDetection, ...]:
    diameters_um = np.concatenate([np.asarray(shot.columns["diameter_um"], np.float64) for shot in shots])
    told = detection(shots, size_classes(diameters_um))
    assert told
    return told


def test_corrected_numbers_hold_the_expected_ones_as_often_as_they_say() -> None:
    held, found = [], []
    for seed in range(40):
        shots, truth_um = spray(seed)
        numbers = class_numbers(truth_um)
        for one in detected(shots):
            if one.n_corrected and one.high_um < 25:
                inside = numbers == class_numbers([np.sqrt(one.low_um * one.high_um)])[0]
                expected = np.count_nonzero(inside)
                held.append(one.n_corrected.low <= expected <= one.n_corrected.high)
                found.append(one.n / (expected))
    assert np.mean(found) < 0.93, "without the correction they are missing"
    assert np.mean(held) > 0.93
    assert len(held) > 100


def test_numbers_are_corrected_only_where_surely_half_is_found() -> None:
    for one in detected(spray(0)[0]):
        if one.found_share is None:
            assert (one.placed, one.n_corrected, one.reason) == (0, None, NONE_PLACED)
        elif one.found_share.low < 0.5:
            assert (one.n_corrected, one.reason) == (None, MAY_BE_FEW)
        else:
            assert one.n_corrected
            assert one.n_corrected.value == one.n / one.found_share.value
            assert one.n_corrected.low <= one.n_corrected.value <= one.n_corrected.high


def test_droplets_ten_times_as_large_are_as_many() -> None:
    one, other = detected(spray(3)[0]), detected(spray(3, 10.0)[0])
    assert [each.n_corrected for each in one] == [each.n_corrected for each in other]
    np.testing.assert_allclose([each.low_um for each in other], [10 * each.low_um for each in one])


def test_without_twins_it_is_null_with_the_remedy() -> None:
    told = spray_statistics([stored_shot(np.full(30, 20.0), shot=shot) for shot in range(2)])
    assert told.detection is None
    assert "--twins" in (told.detection_reason or "")
    assert spray_statistics(spray(1)[0]).detection
