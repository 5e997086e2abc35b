"""Levenberg and Marquardt on a problem whose solution is known, and what it asks of the computer."""

import numpy as np
from threadpoolctl import threadpool_info, threadpool_limits

from processing.calibration.fit.least_squares import minimise
from processing.geometry import FloatArray

TRUTH = np.array([2.0, -0.5])
AT = np.linspace(0, 3, 40)


def residuals_at(parameters: FloatArray) -> FloatArray:
    """Of an exponential, along both coordinates."""
    amplitude, rate = parameters
    seen = amplitude * np.exp(rate * AT) - TRUTH[0] * np.exp(TRUTH[1] * AT)
    return np.column_stack([seen, 0.5 * seen])


def derivatives_at(parameters: FloatArray) -> FloatArray:
    amplitude, rate = parameters
    of_seen = np.column_stack([np.exp(rate * AT), amplitude * AT * np.exp(rate * AT)])
    return np.stack([of_seen, 0.5 * of_seen], axis=1).reshape(-1, 2)


def blas_threads() -> set[int]:
    return {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}


def test_it_finds_the_parameters_that_leave_nothing() -> None:
    found = minimise(residuals_at, derivatives_at, np.array([1.0, 0.0]))
    np.testing.assert_allclose(found, TRUTH, rtol=1e-9)


def test_a_wrong_point_counts_little_where_residuals_are_robust() -> None:
    def with_wrong_point(parameters: FloatArray) -> FloatArray:
        residuals = residuals_at(parameters)
        residuals[7] += 5.0
        return residuals

    plain = minimise(with_wrong_point, derivatives_at, np.array([1.0, 0.0]))
    robust = minimise(with_wrong_point, derivatives_at, np.array([1.0, 0.0]), robust_scale=0.01)
    assert np.abs(robust - TRUTH).max() < 1e-3 < np.abs(plain - TRUTH).max()


def test_small_products_are_left_to_one_thread_and_others_get_theirs_back() -> None:
    during = []

    def watched(parameters: FloatArray) -> FloatArray:
        during.append(blas_threads())
        return residuals_at(parameters)

    with threadpool_limits(limits=2, user_api="blas"):
        minimise(watched, derivatives_at, np.array([1.0, 0.0]))
        assert blas_threads() == {2}
    assert during
    assert all(threads == {1} for threads in during)
