"""Discs that the border of an image cuts, by counting those that it does not."""

import numpy as np
import pytest

from processing.analysis.flat.whole_share import whole_shares

SHAPE = (120, 200)


@pytest.mark.parametrize("diameter_px", [4.0, 30.0, 90.0])
def test_as_many_discs_are_whole_as_are_counted(diameter_px: float) -> None:
    rows, columns = np.random.default_rng(0).uniform([[0], [0]], [[SHAPE[0]], [SHAPE[1]]], (2, 40_000))
    room = np.minimum(np.minimum(rows, SHAPE[0] - rows), np.minimum(columns, SHAPE[1] - columns))
    (share,) = whole_shares(np.array([diameter_px]), SHAPE)
    assert share == pytest.approx(np.mean(room >= diameter_px / 2), abs=0.01)
