"""Blurred discs: exact area, place and blur, in two and three dimensions."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter

from processing.synthetic.stamping import Discs, FloatArray, FloatImage, stamp_discs


def one_disc(
    centre: list[float], radius_px: float, sigma_px: float, opacity: float = 1.0, smear: list[float] | None = None
) -> Discs:
    smears = np.zeros((1, len(centre))) if smear is None else np.array([smear])
    return Discs(np.array([centre]), np.array([radius_px]), np.array([sigma_px]), np.array([opacity]), smears)


def centroid(shadow: FloatImage) -> FloatArray:
    axes = np.indices(shadow.shape).reshape(shadow.ndim, -1)
    return np.asarray(axes @ shadow.ravel().astype(float) / shadow.sum(dtype=float))


@given(st.floats(28, 36), st.floats(28, 36), st.floats(0.3, 12), st.floats(0.7, 3))
@settings(max_examples=60)
def test_disc_has_its_area_and_its_centre(row: float, column: float, radius_px: float, sigma_px: float) -> None:
    shadow = 1 - stamp_discs(one_disc([row, column], radius_px, sigma_px), (65, 65))
    assert shadow.sum(dtype=float) == pytest.approx(np.pi * radius_px**2, rel=1e-3)
    np.testing.assert_allclose(centroid(shadow), [row, column], atol=0.005)


def test_profile_is_a_disc_under_a_gaussian() -> None:
    fine = 8
    row, column = np.indices((65 * fine, 65 * fine)) - (65 * fine - 1) / 2
    disc = (np.hypot(row, column) < 4.2 * fine).astype(float)
    expected = gaussian_filter(disc, 1.3 * fine)[fine // 2 :: fine, fine // 2 :: fine]
    offset = 32 - 0.5 / fine
    shadow = 1 - stamp_discs(one_disc([offset, offset], 4.2, 1.3), (65, 65))
    np.testing.assert_allclose(shadow, expected, atol=0.005)


def test_overlapping_transmittances_multiply() -> None:
    left, right = one_disc([20.0, 18.0], 5, 1, 0.7), one_disc([20.0, 23.0], 4, 1, 0.4)
    both = Discs(
        *(
            np.concatenate([getattr(left, name), getattr(right, name)])
            for name in ("centres", "radii_px", "sigmas_px", "opacities", "smears")
        )
    )
    np.testing.assert_allclose(
        stamp_discs(both, (40, 40)), stamp_discs(left, (40, 40)) * stamp_discs(right, (40, 40)), rtol=1e-5
    )


@pytest.mark.parametrize("centre", [[-3.0, 10.0], [0.2, 0.4], [31.0, 23.5], [33.0, 25.0]])
def test_border_cuts_a_disc_and_nothing_else(centre: list[float]) -> None:
    cut = stamp_discs(one_disc(centre, 4, 1), (32, 24))
    whole = stamp_discs(one_disc([centre[0] + 20, centre[1] + 20], 4, 1), (80, 80))
    np.testing.assert_allclose(cut, whole[20:52, 20:44], atol=1e-6)
    assert cut.min() < 0.9


def test_discs_outside_leave_no_trace() -> None:
    assert stamp_discs(one_disc([500.0, -40.0], 4, 1), (32, 24)).min() == 1


def test_smear_lengthens_by_the_variance_of_its_path() -> None:
    row, column = np.indices((41, 41)) - 20.0
    variances = []
    for smear in ([0.0, 0.0], [0.0, 3.0]):
        shadow = (1 - stamp_discs(one_disc([20.0, 20.0], 2.0, 1.0, 1.0, smear), (41, 41))).astype(float)
        variances.append([(shadow * axis**2).sum() / shadow.sum() for axis in (row, column)])
    assert variances[1][0] == pytest.approx(variances[0][0], abs=0.01)
    assert variances[1][1] - variances[0][1] == pytest.approx(3.0**2 / 12, abs=0.01)


def test_ball_is_round_in_three_dimensions() -> None:
    ball = 1 - stamp_discs(one_disc([12.0, 13.0, 14.0], 3, 1), (25, 27, 29))
    disc = 1 - stamp_discs(one_disc([13.0, 14.0], 3, 1), (27, 29))
    np.testing.assert_allclose(ball[12], disc, atol=1e-6)
    np.testing.assert_allclose(centroid(ball), [12, 13, 14], atol=1e-3)
    np.testing.assert_allclose(ball[:, 13, 14], ball[12, :, 14][1:-1], atol=1e-6)


def test_what_is_no_disc_is_refused() -> None:
    with pytest.raises(ValueError, match="finite places"):
        stamp_discs(one_disc([np.nan, 3.0], 4, 1), (32, 24))
    with pytest.raises(ValueError, match="opacities"):
        stamp_discs(one_disc([3.0, 3.0], 4, 1, opacity=1.5), (32, 24))
    with pytest.raises(ValueError, match="radii and blurs"), np.errstate(divide="ignore"):
        stamp_discs(one_disc([3.0, 3.0], 0.0, 1), (32, 24))
