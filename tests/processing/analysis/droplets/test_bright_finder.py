"""Steps of the search that have a truth of their own."""

import numpy as np
import pytest

from processing.analysis.droplets.bright_finder import merged
from processing.analysis.droplets.candidates import foremost
from processing.analysis.droplets.gaussian_blobs import Blobs
from processing.analysis.droplets.image_noise import noise_of
from processing.analysis.droplets.point_spread import first_optics
from processing.studies.droplets import DropletCase
from tests.support.bright_scenes import scene


def test_close_droplets_become_one_where_their_light_is() -> None:
    blobs = Blobs(np.array([[0.0, 0, 0], [10, 0, 0], [0.9, 0, 0]]), np.array([1.0, 5.0, 2.0]))
    united = merged(blobs, 1.2)
    assert sorted(united.amplitudes) == [3.0, 5.0]
    np.testing.assert_allclose(united.positions_voxel[np.argmin(united.amplitudes)], [0.6, 0, 0])


def test_distant_droplets_and_none_stay_as_they_are() -> None:
    blobs = Blobs(np.array([[0.0, 0, 0], [1.3, 0, 0]]), np.array([2.0, 1.0]))
    np.testing.assert_array_equal(merged(blobs, 1.2).positions_voxel, blobs.positions_voxel)
    assert len(merged(Blobs.none(), 1.2)) == 0


def test_only_the_highest_of_neighbouring_peaks_is_tried() -> None:
    peaks = np.array([[0.0, 0, 0, 1], [2, 0, 0, 3], [4, 0, 0, 2], [9, 0, 0, 0.5]])
    assert {tuple(place) for place in foremost(peaks, 2.5).tolist()} == {(2, 0, 0, 3), (9, 0, 0, 0.5)}
    assert foremost(np.empty((0, 4)), 2.5).shape == (0, 4)


@pytest.mark.parametrize("noise_percent", [1.0, 3.0, 10.0])
def test_noise_is_seen_in_spite_of_droplets(noise_percent: float) -> None:
    for image in scene(DropletCase(14, noise_percent=noise_percent)).images:
        assert noise_of(image) == pytest.approx(noise_percent / 100, rel=0.2)


@pytest.mark.parametrize("sigma_px", [0.8, 1.0, 1.5])
def test_the_first_guess_of_the_width_is_near(sigma_px: float) -> None:
    optics = first_optics(scene(DropletCase(28, sigma_px)).images)
    np.testing.assert_allclose(optics.sigmas_px, sigma_px, rtol=0.2)
    np.testing.assert_allclose(optics.gains, 1, rtol=0.1)
