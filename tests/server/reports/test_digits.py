"""Digits of what is told: as many as an interval bears, and as many as it takes to see it."""

import pytest

from server.reports.digits import digits_of_interval


@pytest.mark.parametrize(
    ("told", "texts"),
    [
        ((18.61508, 18.59426, 18.6359), ("18.615", "18.594", "18.636")),
        ((62.1428, 55.1588, 70.0111), ("62.1", "55.2", "70.0")),
        ((1234.5, 1229.6, 1239.4), ("1234.5", "1229.6", "1239.4")),
        ((133.0, 7.29, 2437.0), ("133", "7.29", "2440")),
        ((4.1e7, 9.1e6, 1.9e8), ("4.10e+07", "9.10e+06", "1.90e+08")),
        ((0.5, 0.5 - 1e-16, 0.5 + 1e-16), ("0.500", "0.500", "0.500")),
        ((0.0, 0.0, 0.0), ("0.00", "0.00", "0.00")),
        ((-18.61508, -18.6359, -18.59426), ("-18.615", "-18.636", "-18.594")),
    ],
)
def test_a_narrow_interval_is_seen(told: tuple[float, float, float], texts: tuple[str, str, str]) -> None:
    assert digits_of_interval(*told) == texts
