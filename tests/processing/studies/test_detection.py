"""Found droplets and ghosts at all thresholds, and the choice of one."""

import numpy as np
import pytest

from processing.studies.detection import (
    DetectionCurve,
    DetectionRates,
    best_threshold,
    detection_curve,
    half_median_threshold,
)
from processing.studies.simulated_droplets import blob_volume
from tests.support import oracle

CENTRES = np.array([[8.0, 8.0, 8.0], [8.0, 24.0, 24.0], [24.0, 8.0, 24.0]])
GHOSTS = np.array([[24.0, 24.0, 8.0]])


def curve_of(heights: list[float], real: list[bool]) -> DetectionCurve:
    flags = np.array(real)
    ranks = np.arange(1, len(flags) + 1)
    return DetectionCurve(np.array(heights), np.cumsum(flags) / flags.sum(), np.cumsum(~flags) / ranks)


def test_a_ghost_is_counted_once_the_threshold_lets_it_in() -> None:
    volume = blob_volume((32, 32, 32), CENTRES, 1.0) + np.float32(0.3) * blob_volume((32, 32, 32), GHOSTS, 1.0)
    curve = detection_curve(CENTRES, volume)
    assert (curve.rates(0.5).found, curve.rates(0.5).ghosts) == (1.0, 0.0)
    assert (curve.rates(0.1).found, curve.rates(0.1).ghosts) == (1.0, 0.25)
    assert (curve.rates(2.0).found, curve.rates(2.0).ghosts) == (0.0, 0.0)


def test_two_droplets_in_one_peak_are_one_found() -> None:
    together = np.array([[8.0, 8.0, 7.5], [8.0, 8.0, 8.6]])
    curve = detection_curve(together, blob_volume((16, 16, 16), together, 1.5))
    assert curve.rates(0.5) == DetectionRates(found=0.5, ghosts=0.0)


def test_the_rates_are_those_of_the_textbook_where_droplets_are_apart() -> None:
    volume = blob_volume((32, 32, 32), CENTRES, 1.0) + np.float32(0.6) * blob_volume((32, 32, 32), GHOSTS, 1.0)
    volume *= 1 + 0.2 * np.random.default_rng(1).random(volume.shape, dtype=np.float32)
    curve = detection_curve(CENTRES, volume)
    for threshold in (0.05, 0.3, 0.9):
        assert curve.rates(threshold) == oracle.detection_rates(CENTRES, volume, threshold)


def test_an_empty_volume_has_no_peaks() -> None:
    curve = detection_curve(CENTRES, np.zeros((8, 8, 8), np.float32))
    assert curve.rates(half_median_threshold(curve)).found == 0
    assert best_threshold(curve) == 0


def test_the_best_threshold_separates_what_can_be_separated() -> None:
    curve = curve_of([1.0, 0.9, 0.8, 0.3, 0.2], [True, True, True, False, False])
    rates = curve.rates(best_threshold(curve))
    assert (rates.found, rates.ghosts) == (1.0, 0.0)


@pytest.mark.parametrize("scale", [1.0, 1e-6])
def test_half_the_median_leaves_out_faint_ghosts_at_any_scale_of_intensity(scale: float) -> None:
    rng = np.random.default_rng(3)
    heights = scale * np.sort(np.concatenate([rng.normal(1, 0.1, 500), rng.uniform(0, 0.3, 800)]))[::-1]
    assert half_median_threshold(curve_of(list(heights), [True] * 1300)) == pytest.approx(0.5 * scale, rel=0.02)


def test_half_the_median_does_not_stop_at_a_bright_outlier() -> None:
    heights = [5.0, *np.linspace(1.1, 0.9, 399)]
    assert half_median_threshold(curve_of(heights, [True] * 400)) == pytest.approx(0.5, rel=0.02)
