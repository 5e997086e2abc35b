"""What liquid hides on one side of a spray makes it no less even: it counts as the rest of its cell, or is null."""

import json

import numpy as np
import pytest
from numpy.typing import NDArray

from processing.analysis.cells import cells_along, measured_percent
from processing.analysis.droplets.droplet_file import StoredDroplets
from processing.analysis.spray.patternation import Patternation, patternation
from processing.analysis.spray.spray_axis import SprayAxis
from processing.analysis.spray.spray_sample import bounds_mm, spray_sample
from processing.geometry import FloatArray
from tests.support.sampled_sprays import BOX, cone_shots

DOWN = SprayAxis((0, 0, 0), (0, 1, 0))
LOW_MM, HIGH_MM = bounds_mm(BOX)


def seen(points_mm: FloatArray, share: float, shot: int) -> NDArray[np.bool_]:
    """Places that liquid does not hide: in a quarter around the axis it hides this share of all columns of cells."""
    x, y, z = cells_along(HIGH_MM - LOW_MM)
    cell = np.floor((points_mm - LOW_MM) / (HIGH_MM - LOW_MM) * (x, y, z)).astype(int)
    drawn = np.random.default_rng(shot).random((x + 1, z + 1)) < share
    behind = (points_mm[:, 0] > 0) & (points_mm[:, 2] > 0)
    return np.asarray(~(behind & drawn[cell[:, 0], cell[:, 2]]), np.bool_)


def hidden(share: float, shot: StoredDroplets) -> StoredDroplets:
    """A shot without the droplets that liquid hides, which says where it does."""
    number = int(shot.provenance["shot"])
    percent = measured_percent(BOX.shape, lambda places: seen(LOW_MM + places * (HIGH_MM - LOW_MM), share, number))
    told = {"volume_share": 1 - float(np.mean(percent["xz"])) / 100, "measured_percent": percent}
    rows = seen(np.column_stack([np.asarray(shot.columns[f"{axis}_mm"]) for axis in "xyz"]), share, number)
    exposures = {"a": {"verdict": "good", "reasons": [], "residual_over_noise": 1.0, "hidden": told}}
    columns = {name: np.asarray(values)[rows] for name, values in shot.columns.items()}
    return StoredDroplets(columns, {**shot.provenance, "exposures": json.dumps(exposures)})


def told(share: float) -> Patternation:
    one = patternation(spray_sample([hidden(share, shot) for shot in cone_shots(0, 12, 1500)]), DOWN, 10.0, 1.0)
    assert one
    return one


@pytest.mark.parametrize("share", [0.0, 0.35])
def test_an_even_cone_is_even_where_liquid_hides_a_part_of_a_quarter(share: float) -> None:
    one = told(share)
    assert one.asymmetry is not None
    assert one.asymmetry_by_chance is not None
    assert one.asymmetry < one.asymmetry_by_chance


def test_shares_are_not_told_where_liquid_hides_a_whole_quarter() -> None:
    one = told(1.0)
    assert (one.sector_shares, one.asymmetry) == ((), None)
    assert "liquid hides a part of it" in str(one.reason)
    behind = np.array([[cell is None for cell in ring] for ring in one.liquid_ppm])
    assert behind.any(axis=0).tolist() == [False] * 6 + [True, True]
