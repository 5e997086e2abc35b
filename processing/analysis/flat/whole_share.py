"""How often a droplet of a size is seen whole: the border of an image cuts large ones more often than small ones.

A disc that lies anywhere, with equal chance, is whole within an image of W x H where its centre is in (W - D)(H - D)
(Miles 1974, Lantuejoul 1978). Means that weigh each droplet by the inverse of that share are those of the spray.
"""

import numpy as np

from processing.geometry import FloatArray


def whole_shares(diameters_px: FloatArray, shape: tuple[int, ...]) -> FloatArray:
    """Share of the image in which the centre of a disc that is seen whole may lie.

    Parameters
    ----------
    diameters_px : (N,) array
        Of discs that are whole.
    shape : int, int
        Rows and columns of the image.

    Returns
    -------
    (N,) array
        Above 0, to 1.
    """
    rows, columns = shape
    room = (rows - diameters_px) * (columns - diameters_px) / (rows * columns)
    return np.asarray(np.maximum(room, 1 / (rows * columns)))
