"""The studies' shots: droplets lie where they were put, and cameras see them there."""

import numpy as np

from processing.studies.simulated_droplets import (
    blob_volume,
    droplet_centres,
    normalised,
    project_volume,
    simulate_shot,
    study_cameras,
    study_grid,
)

SHAPE = (64, 128, 128)


def test_a_blob_lies_where_it_was_put() -> None:
    centres = droplet_centres((30, 40, 50), 1, np.random.default_rng(7))
    volume = blob_volume((30, 40, 50), centres, 1.5)
    weights = volume / volume.sum()
    centroid = [float((weights * axis).sum()) for axis in np.indices(volume.shape)]
    np.testing.assert_allclose(centroid, centres[0], atol=0.02)


def test_droplets_fill_the_volume_evenly() -> None:
    centres = droplet_centres((30, 40, 50), 4000, np.random.default_rng(1))
    np.testing.assert_allclose(centres.mean(axis=0), [14.5, 19.5, 24.5], atol=0.7)
    assert (centres >= 0).all()
    assert (centres.max(axis=0) > np.array([28.5, 38.5, 48.5])).all()


def test_projection_puts_a_blob_where_the_camera_sees_it() -> None:
    grid = study_grid(SHAPE)
    centres = droplet_centres(SHAPE, 1, np.random.default_rng(7))
    volume = blob_volume(SHAPE, centres, 1.5)
    for camera in study_cameras((192, 156)):
        image = project_volume(volume, grid, camera)
        rows, columns = np.indices(image.shape)
        centroid = [(image * columns).sum() / image.sum(), (image * rows).sum() / image.sum()]
        np.testing.assert_allclose(centroid, camera.project(grid.to_mm(centres))[0], atol=0.1)


def test_images_are_normalised_together() -> None:
    one, two = normalised([np.full((2, 2), 2.0, np.float32), np.full((2, 2), 4.0, np.float32)])
    assert float(one.max()) == 0.5
    assert float(two.max()) == 1.0


def test_the_same_shot_comes_back() -> None:
    cameras, grid = study_cameras((96, 96)), study_grid((20, 30, 40))
    first, again = (simulate_shot(grid, 9, 1.5, cameras) for _ in range(2))
    assert len(first.centres_voxel) == 9
    for image, repeated in zip(first.images, again.images, strict=True):
        np.testing.assert_array_equal(image, repeated)
