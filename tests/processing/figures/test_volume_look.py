"""What a figure of a volume shows is that of the volume, however many slabs it comes in."""

import numpy as np
import pytest

from processing.figures.volume_look import GrowingLook
from processing.reconstruction.slab_volume import SLAB_ROWS, slabs_of


@pytest.mark.parametrize("shape", [(5, 7, 9), (6, 2 * SLAB_ROWS + 5, 4), (1, SLAB_ROWS, 1)])
def test_it_has_the_fullest_planes_and_the_maxima_along_every_axis(shape: tuple[int, int, int]) -> None:
    volume = np.random.default_rng(5).random(shape).astype(np.float32)
    growing = GrowingLook(shape)
    for first_row, slab in growing.watching(slabs_of(volume)):
        np.testing.assert_array_equal(slab, volume[:, first_row : first_row + slab.shape[1]])
    look = growing.look(lambda axis, index: np.take(volume, index, axis))
    for axis, others in enumerate([(1, 2), (0, 2), (0, 1)]):
        assert look.fullest[axis] == volume.sum(axis=others, dtype=np.float64).argmax()
        np.testing.assert_array_equal(look.slices[axis], volume.take(look.fullest[axis], axis))
        np.testing.assert_array_equal(look.projections[axis], volume.max(axis=axis))
