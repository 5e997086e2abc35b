"""The mean of a few shots, binned: the ring lies on the cone, and SMART has the steepest flanks."""

import numpy as np
import pytest

from processing.reconstruction.choices import ReconstructionMethod
from processing.studies.average import (
    AverageStudy,
    MeanSlices,
    average_figure,
    average_rows,
    average_statements,
    average_study,
    profile_rows,
)
from processing.studies.hollow_cone_shots import cropped_cameras, height_mm, hollow_cone_images
from processing.synthetic.paper_rig import paper_cameras

SMALL = AverageStudy(shots=12, binning=4, rows=9)


@pytest.fixture(scope="module")
def mean() -> MeanSlices:
    return average_study(SMALL)


def test_the_ring_lies_where_the_cone_is(mean: MeanSlices) -> None:
    on_cone_mm = 25 * 0.2 * np.tan(np.deg2rad(63 / 2))
    for row in average_rows(mean):
        assert row.ring_mm == pytest.approx(on_cone_mm, abs=0.15)


def test_the_ring_is_narrowest_by_smart_then_mlos_minimum_and_geometric_average(mean: MeanSlices) -> None:
    rows = {row.method: row for row in average_rows(mean)}
    order = [rows[method] for method in ("smart", "mlos", "minlos", "gavlos")]
    assert [row.width_mm for row in order] == sorted(row.width_mm for row in order)
    assert [row.centre for row in order] == sorted(row.centre for row in order)


def test_flanks_are_steepest_by_smart_then_mlos_minimum_and_geometric_average(mean: MeanSlices) -> None:
    rows = {row.method: row for row in average_rows(mean)}
    for steep, flat in (("smart", "mlos"), ("mlos", "minlos"), ("minlos", "gavlos")):
        assert rows[steep].inner_gradient_per_mm > rows[flat].inner_gradient_per_mm
        assert rows[steep].height > rows[flat].height


def test_more_shots_are_told_one_by_one_and_averaged() -> None:
    told: list[int] = []
    study = AverageStudy(shots=2, binning=8, rows=5)
    both = average_study(study, told.append)
    assert told == [1, 2]
    first = average_study(AverageStudy(shots=1, binning=8, rows=5))
    assert set(both.slices) == {"gavlos", "minlos", "mlos", "smart"}
    assert (2 * both.slices["minlos"] >= first.slices["minlos"] - 1e-6).all()


def test_a_cropped_camera_sees_what_the_whole_one_sees() -> None:
    grid = SMALL.grid
    points_mm = np.array([[0.0, height_mm(25), 0.0], [3.0, height_mm(25) + 0.2, -2.0]])
    for name, camera in cropped_cameras(grid, 4).items():
        shift_px = paper_cameras(4)[name].project(points_mm) - camera.project(points_mm)
        np.testing.assert_allclose(shift_px[:, 0], 0, atol=1e-9)
        np.testing.assert_allclose(shift_px[:, 1], shift_px[0, 1], atol=1e-9)
        corners_px = camera.project(np.array([[x, y, z] for x in (-4, 4) for y in grid.y_mm for z in (-4, 4)]))
        assert (corners_px[:, 1] > 20).all()
        assert (corners_px[:, 1] < camera.image_size_px[1] - 21).all()


def test_images_are_intensities_and_the_same_again() -> None:
    cameras = cropped_cameras(AverageStudy(binning=8).grid, 8)
    first, again = (next(hollow_cone_images(cameras, 1, 8, seed=4)) for _ in range(2))
    for image, repeated in zip(first, again, strict=True):
        assert 0 <= float(image.min()) <= float(image.max()) <= 1
        assert float(image.max()) > 0.3
        np.testing.assert_array_equal(image, repeated)


def test_the_defaults_are_the_papers() -> None:
    study = AverageStudy()
    assert (study.shots, study.diameters_from_orifice) == (266, 25)
    assert [recipe.method for recipe in study.recipes] == [
        ReconstructionMethod.GAVLOS,
        ReconstructionMethod.MINLOS,
        ReconstructionMethod.MLOS,
        ReconstructionMethod.SMART,
    ]


def test_figure_profiles_and_statements_name_every_method(mean: MeanSlices) -> None:
    figure = average_figure(mean)
    titles = [axes.get_title() for axes in figure.axes if axes.get_title()]
    assert titles == ["GAVLOS", "MINLOS", "MLOS", "SMART-20"]
    assert {row.method for row in profile_rows(mean)} == set(mean.slices)
    inner, outer = average_statements(average_rows(mean))
    assert "inner" in inner.topic
    assert "outer" in outer.topic
    assert all(title in inner.ours for title in titles)
