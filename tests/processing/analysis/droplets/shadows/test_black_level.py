"""The black level is the one at which droplets leave least, and as sure as they agree."""

import numpy as np
import pytest

from processing.analysis.droplets.shadows.black_level import LOWEST, STEP, BlackLevel, black_level
from processing.geometry import FloatArray


def droplets(true_share: float, scatter: float) -> list[float]:
    """Levels at which each of them leaves least."""
    return list(true_share + scatter * np.random.default_rng(1).standard_normal(40))


@pytest.mark.parametrize("true_share", [-0.13, -0.06, 0.0, 0.02, 0.2, 0.35])
def test_it_is_found_wherever_it_is(true_share: float) -> None:
    best = np.array(droplets(true_share, 0.02))

    def left(share: float) -> FloatArray:
        return np.exp(((share - best) / 0.08) ** 2)

    level = black_level(left)
    assert level.share == pytest.approx(best.mean(), abs=1e-3)
    assert level.sd == pytest.approx(0.02 / np.sqrt(40), rel=0.4)
    assert bool(level.doubts) == (abs(true_share) > 0.03)


def test_what_every_level_explains_alike_says_nothing() -> None:
    noise = np.random.default_rng(2).uniform(0.5, 2, (99, 12))
    assert black_level(lambda share: noise[round(100 * share)]).doubts == ()


def noise_is_doubted(seed: int) -> bool:
    noise = 0.02 * np.random.default_rng(seed).standard_normal((8, 40))
    return bool(black_level(lambda share: np.exp(noise[round(share / STEP) - LOWEST])).doubts)


def test_noise_alone_is_seldom_doubted() -> None:
    """Of other droplets another level would be the best one by far: that is what is not known of it."""
    assert sum(map(noise_is_doubted, range(100))) < 20


def test_a_veil_beyond_all_that_are_tried_is_told() -> None:
    level = black_level(lambda share: np.full(20, 2 - share))
    assert "behind a veil" in level.doubts[0]


def test_limits_grow_with_what_is_not_known() -> None:
    assert BlackLevel(0.05, 0.001).doubts
    assert not BlackLevel(0.045, 0.01).doubts
