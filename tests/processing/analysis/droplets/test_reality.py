"""What makes a droplet probably real, and where that is not told."""

from dataclasses import replace

import numpy as np
import pytest

from processing.analysis.droplets.bright_shot import REALITY as OF_SPOTS
from processing.analysis.droplets.reality import CROWD_PX, Evidence, Reality, crowding
from processing.analysis.droplets.shadows.shadow_table import REALITY as OF_SHADOWS

KNOWN = np.array([4])
DROPLET = Evidence(
    together=np.array([1.0]),
    alone=np.full((4, 1), 1.0),
    alone_sd=np.full((4, 1), 0.05),
    residual=np.array([1.0]),
    crowding=np.array([0.05]),
    width_px=1.2,
    directions=4,
)
BOTH = pytest.mark.parametrize("reality", [OF_SPOTS, OF_SHADOWS], ids=["spots", "shadows"])


def told(reality: Reality, evidence: Evidence) -> float:
    (value,) = reality.p_real(evidence, KNOWN)
    return float(value)


@BOTH
def test_a_droplet_on_which_all_views_agree_is_real(reality: Reality) -> None:
    assert told(reality, DROPLET) > 0.99


@BOTH
@pytest.mark.parametrize(
    "worse",
    [
        {"alone_sd": np.full((4, 1), 0.25)},
        {"alone": np.array([[1.5], [1.5], [0.9], [0.1]])},
        {"residual": np.array([1.6])},
        {"crowding": np.array([0.4])},
    ],
    ids=["faint", "disputed", "unexplained", "crowded"],
)
def test_what_speaks_against_it_makes_it_less_probable(reality: Reality, worse: dict[str, np.ndarray]) -> None:
    assert told(reality, replace(DROPLET, **worse)) < told(reality, DROPLET)  # type: ignore[arg-type]


@BOTH
def test_nothing_is_told_where_it_was_not_tried(reality: Reality) -> None:
    three = replace(DROPLET, alone=DROPLET.alone[:3], alone_sd=DROPLET.alone_sd[:3])
    untried = [three, replace(DROPLET, crowding=np.array([2.0])), replace(DROPLET, width_px=5.0)]
    untried.append(replace(DROPLET, directions=2))
    assert np.isnan([told(reality, evidence) for evidence in untried]).all()
    assert np.isnan(reality.p_real(DROPLET, np.array([3]))).all()


def test_an_image_without_noise_leaves_nothing_and_is_no_miracle() -> None:
    assert told(OF_SPOTS, replace(DROPLET, residual=np.array([0.0]))) == pytest.approx(1)


def test_crowding_is_the_mean_of_what_others_cover_around_a_droplet() -> None:
    seen_px = np.array([[[0, 0], [CROWD_PX / 2, 0], [500, 0]], [[0, 0], [0, 300], [0, 600]]], dtype=np.float64)
    expected = np.array([9.0, 4.0, 0.0]) / CROWD_PX**2 / 2
    np.testing.assert_allclose(crowding(seen_px, np.array([4.0, 9.0, 25.0])), expected)
    assert crowding(np.empty((2, 0, 2)), np.empty(0)).shape == (0,)
