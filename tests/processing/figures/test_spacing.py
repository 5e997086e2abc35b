"""Panels have one size, and leave the room that is stated."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from processing.figures.spacing import Room, rounded_down, spaced_panels


@pytest.mark.parametrize(("rows", "columns"), [(1, 1), (1, 4), (3, 2)])
def test_panels_leave_the_stated_room(rows: int, columns: int) -> None:
    room = Room(left=0.8, right=0.1, bottom=0.5, top=0.4, across=0.6, down=0.7)
    panels = spaced_panels(Figure(figsize=(12, 8)), rows, columns, room)
    places_in = np.array([[axes.get_position().extents * (12, 8, 12, 8) for axes in row] for row in panels])
    left, bottom, right, top = np.moveaxis(places_in, -1, 0)
    np.testing.assert_allclose(left[:, 0], 0.8)
    np.testing.assert_allclose(right[:, -1], 12 - 0.1)
    np.testing.assert_allclose(bottom[-1], 0.5)
    np.testing.assert_allclose(top[0], 8 - 0.4)
    np.testing.assert_allclose(left[:, 1:] - right[:, :-1], 0.6)
    np.testing.assert_allclose(bottom[:-1] - top[1:], 0.7)
    np.testing.assert_allclose(right - left, right[0, 0] - left[0, 0])
    np.testing.assert_allclose(top - bottom, top[0, 0] - bottom[0, 0])


@pytest.mark.parametrize(("value", "key"), [(0.0, 1e-9), (0.7, 0.5), (1.0, 1.0), (4.9, 2.0), (50.0, 50.0)])
def test_a_scale_has_a_key_where_nothing_moves_too(value: float, key: float) -> None:
    """A report of droplets at rest ended in a traceback."""
    assert rounded_down(value) == pytest.approx(key)
