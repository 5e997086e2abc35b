"""The density study, reduced: the paper's trends, reproducible, drawn and written."""

import csv
import io

import numpy as np
import pytest

from processing.reconstruction.method import ReconstructionMethod
from processing.studies.density import (
    DensityRow,
    DensityStudy,
    blob_volume,
    density_csv,
    density_figure,
    density_study,
    normalised,
    project_volume,
    study_cameras,
)

SMALL = DensityStudy(shape=(64, 128, 128), counts=(64, 512, 2500), image_size_px=(192, 156), iterations=8)
"""A quarter of the paper's depth, so four times its densities for images as crowded as its."""


@pytest.fixture(scope="module")
def rows() -> list[DensityRow]:
    return list(density_study(SMALL))


def quality(rows: list[DensityRow], method: str) -> list[float]:
    return [row.quality_factor for row in rows if row.method == method]


def test_quality_falls_with_density(rows: list[DensityRow]) -> None:
    for method in SMALL.methods:
        assert (np.diff(quality(rows, method.value)) < 0).all()


def test_smart_is_best_and_mlos_the_best_line_of_sight_when_dense(rows: list[DensityRow]) -> None:
    for smart, *others in zip(*(quality(rows, m) for m in ("smart", "mlos", "minlos", "gavlos")), strict=True):
        assert smart > max(others)
    assert quality(rows, "mlos")[-1] > max(quality(rows, "minlos")[-1], quality(rows, "gavlos")[-1])


def test_density_is_per_cubic_millimetre(rows: list[DensityRow]) -> None:
    assert rows[0].density_per_mm3 == pytest.approx(64 / (64 * 128 * 128 / 60**3))
    assert DensityStudy().counts[0] / DensityStudy().grid.volume_mm3 == pytest.approx(3.456)


def test_the_same_study_gives_the_same_rows() -> None:
    study = DensityStudy(shape=(64, 64, 64), counts=(20,), image_size_px=(128, 96), iterations=2)
    assert list(density_study(study)) == list(density_study(study))


def test_a_blob_lies_where_it_was_put() -> None:
    volume = blob_volume((30, 40, 50), 1, 1.5, np.random.default_rng(7))
    x, y, z = np.random.default_rng(7).uniform(0, [49, 39, 29])
    weights = volume / volume.sum()
    centroid = [float((weights * axis).sum()) for axis in np.indices(volume.shape)]
    np.testing.assert_allclose(centroid, [z, y, x], atol=0.02)


def test_projection_conserves_a_blob_and_puts_it_where_the_camera_sees_it() -> None:
    volume = blob_volume(SMALL.shape, 1, 1.5, np.random.default_rng(7))
    x, y, z = np.random.default_rng(7).uniform(0, np.array(SMALL.shape[::-1]) - 1)
    for camera in study_cameras(SMALL.image_size_px):
        image = project_volume(volume, SMALL.grid, camera)
        rows, columns = np.indices(image.shape)
        centroid = [(image * columns).sum() / image.sum(), (image * rows).sum() / image.sum()]
        expected = camera.project(SMALL.grid.to_mm(np.array([[z, y, x]])))[0]
        np.testing.assert_allclose(centroid, expected, atol=0.1)


def test_images_are_normalised_together() -> None:
    one, two = normalised([np.full((2, 2), 2.0, np.float32), np.full((2, 2), 4.0, np.float32)])
    assert float(one.max()) == 0.5
    assert float(two.max()) == 1.0


def test_the_csv_has_every_row(rows: list[DensityRow]) -> None:
    read = list(csv.DictReader(io.StringIO(density_csv(rows))))
    assert list(read[0]) == ["density_per_mm3", "method", "quality_factor", "sigma_voxel"]
    assert [float(row["quality_factor"]) for row in read] == [row.quality_factor for row in rows]


def test_the_figure_has_a_curve_per_method_and_the_papers_statement(rows: list[DensityRow]) -> None:
    axes = density_figure(rows, SMALL).axes[0]
    legend = axes.get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == ["MLOS", "MINLOS", "GAVLOS", "SMART"]
    curve = axes.lines[0].get_xydata()
    np.testing.assert_allclose(np.asarray(curve)[:, 1], quality(rows, "mlos"))
    assert "20 droplets" in axes.texts[0].get_text()
    assert "1/mm" in axes.get_xlabel()


def test_the_papers_figure_is_reproduced() -> None:
    """The middle of Fig. 7 at full size: what an independent implementation found, within 0.04."""
    methods = (ReconstructionMethod.MLOS, ReconstructionMethod.MINLOS, ReconstructionMethod.GAVLOS)
    found = {row.method: row.quality_factor for row in density_study(DensityStudy(counts=(4000,), methods=methods))}
    assert found == pytest.approx({"mlos": 0.64, "minlos": 0.56, "gavlos": 0.42}, abs=0.04)
