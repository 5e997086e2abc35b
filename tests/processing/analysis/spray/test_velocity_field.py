"""Mean velocities by cells: of a cone they point away from the nozzle, and of few droplets none is told."""

from dataclasses import replace

import numpy as np
import pytest

from processing.analysis.spray.spray_axis import SprayAxis
from processing.analysis.spray.spray_sample import SpraySample, spray_sample
from processing.analysis.spray.velocity_field import field_across_axis, field_through_axis
from tests.support.sampled_sprays import cone_shots

AXIS = SprayAxis((0, 0, 0), (0, 1, 0))


@pytest.fixture(scope="module")
def sample() -> SpraySample:
    """Of a hollow cone around +y, 8 to 12 mm below its nozzle at the origin; droplets fly away from the nozzle."""
    return spray_sample(cone_shots(0, 8, 300))


def test_through_the_axis_arrows_point_away_from_the_nozzle(sample: SpraySample) -> None:
    field = field_through_axis(sample, AXIS)
    assert field
    assert (field.across, field.down) == ("x", "y")
    across_mm, down_mm = (edges[:-1] + np.diff(edges) / 2 for edges in (field.across_mm, field.down_mm))
    known = np.isfinite(field.axial_m_s)
    slopes = (field.mean_m_s[..., 0] / field.mean_m_s[..., 1])[known]
    places = np.broadcast_to(across_mm, known.shape)[known] / np.broadcast_to(down_mm[:, None], known.shape)[known]
    np.testing.assert_allclose(slopes, places, atol=0.08)
    np.testing.assert_array_equal(field.axial_m_s[known], field.mean_m_s[..., 1][known])


def test_across_the_axis_columns_and_rows_go_up_with_the_coordinates(sample: SpraySample) -> None:
    field = field_across_axis(sample, AXIS)
    assert field
    assert (field.across, field.down) == ("x", "z")
    known = np.isfinite(field.axial_m_s)
    down_mm = (field.down_mm[:-1] + np.diff(field.down_mm) / 2)[:, None] * np.ones(known.shape)
    away = known & (np.abs(down_mm) > 1)
    assert (np.sign(field.mean_m_s[..., 1][away]) == np.sign(down_mm[away])).all()


def test_cells_of_few_droplets_are_counted_and_not_told(sample: SpraySample) -> None:
    field = field_across_axis(sample, AXIS)
    doubled = field_across_axis(replace(sample, exposures_per_shot=2.0), AXIS)
    assert field
    assert doubled
    np.testing.assert_array_equal(np.isfinite(field.axial_m_s), field.n >= 5)
    assert ((field.n > 0) & (field.n < 5)).any()
    assert doubled.n.sum() == pytest.approx(field.n.sum() / 2, rel=0.1), "two exposures show the same droplets"
    assert field_across_axis(sample.chosen(np.arange(len(sample)) < 4), AXIS) is None


def test_a_flat_box_has_no_slice_through_the_axis(sample: SpraySample) -> None:
    assert sample.box_mm is not None
    flat = replace(sample, box_mm=np.array([sample.box_mm[0], [*sample.box_mm[1, :1], 8.5, sample.box_mm[1, 2]]]))
    assert field_through_axis(flat, AXIS) is None
    assert field_across_axis(flat, AXIS)
    assert field_across_axis(replace(sample, box_mm=None), AXIS) is None


def test_a_direction_without_a_name_is_told_as_a_vector(sample: SpraySample) -> None:
    field = field_through_axis(sample, SprayAxis((0, 0, 0), (0.2, 1, 0)))
    assert field
    assert field.across == "(0.98, -0.2, 0)"
