"""How good a reconstruction is, where the truth is known: quality factor, found and ghost droplets."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter

from processing.count import require_count
from processing.masked import require_unmasked

Volume = NDArray[np.floating]
Sums = NDArray[np.float64]


def quality_factor(
    truth: Volume, volume: Volume, window: int = 64, step: int = 32, mean_subtracted: bool = True
) -> float:
    """Cross-correlation coefficient c_II of truth and reconstruction, averaged over interrogation windows.

    Parameters
    ----------
    truth, volume : (z, y, x) arrays
        Intensities on the same grid; the scale of neither matters.
    window : int
        Edge length of the cubic windows in voxels, a multiple of ``step``.
    step : int
        Voxels from window to window.
    mean_subtracted : bool
        Whether the mean of each window is subtracted first. Say so wherever a number is published.

    Returns
    -------
    float
        1 for a perfect reconstruction. Windows in which either volume is constant have no say, nor have voxels beyond
        the last window of an axis, (n - window) % step of them: cut both volumes to look at these.

    Raises
    ------
    ValueError
        Shapes differ, a voxel is masked or not finite, no window fits in, ``window`` is no multiple of ``step``, or no
        window has a say.
    """
    for name, array in (("truth", truth), ("volume", volume)):
        if not isinstance(array, np.ndarray):
            raise ValueError(f"{name} is a {type(array).__name__}: an array (z, y, x), please")
    if truth.shape != volume.shape:
        raise ValueError(f"truth has shape {truth.shape}, volume {volume.shape}")
    require_count("window", window, 1)
    require_count("step", step, 1)
    if truth.ndim != 3 or window % step or min(truth.shape) < window:
        raise ValueError(f"windows of {window} voxels at steps of {step} do not fit shape {truth.shape}")
    require_unmasked("truth", truth)
    require_unmasked("volume", volume)
    first, second, products = _window_sums(truth, volume, window, step)
    if not np.isfinite(products).all():
        raise ValueError("a voxel of truth or volume is infinite or not a number")
    covariance, first_power, second_power = products
    if mean_subtracted:
        count = float(window) ** 3
        covariance = covariance - first * second / count
        first_power, second_power = first_power - first**2 / count, second_power - second**2 / count
    # what is left of a constant window after the subtraction is rounding
    varies = (first_power > 1e-9 * products[1]) & (second_power > 1e-9 * products[2])
    if not varies.any():
        raise ValueError("truth and volume vary together in no window")
    return float(np.mean(covariance[varies] / np.sqrt(first_power[varies] * second_power[varies])))


def local_maxima(volume: Volume, threshold: float) -> NDArray[np.intp]:
    """Indices (N, 3) of voxels above a threshold that none of their 26 neighbours exceeds."""
    highest = maximum_filter(volume, size=3, mode="constant", cval=-np.inf)
    return np.argwhere((volume > threshold) & (volume == highest))


def _window_sums(truth: Volume, volume: Volume, window: int, step: int) -> tuple[Sums, Sums, tuple[Sums, Sums, Sums]]:
    """Sums over all windows of both volumes, and of the products (ab, aa, bb); one layer of blocks at a time."""
    starts = range(0, truth.shape[0] - step + 1, step)
    layers = [_layer_sums(truth[z : z + step], volume[z : z + step], step) for z in starts]
    first, second, *products = (_moving_sums(blocks, window // step) for blocks in np.stack(layers, axis=1))
    return first, second, (products[0], products[1], products[2])


def _layer_sums(truth: Volume, volume: Volume, step: int) -> Sums:
    """Sums (5, ny, nx) of a, b, ab, aa and bb over the blocks of a layer; row by row, so that a row stays in cache."""
    ny, nx = (n // step for n in truth.shape[1:])
    sums = np.empty((5, ny, nx))
    for row in range(ny):
        span = np.s_[:, row * step : (row + 1) * step, : nx * step]
        a, b = (values[span].astype(np.float64).reshape(-1, nx * step) for values in (truth, volume))
        columns = [a.sum(axis=0), b.sum(axis=0), *(np.einsum("ij,ij->j", *pair) for pair in ((a, b), (a, a), (b, b)))]
        sums[:, row] = np.stack(columns).reshape(5, nx, step).sum(axis=2)
    return sums


def _moving_sums(blocks: Sums, count: int) -> Sums:
    windows = np.lib.stride_tricks.sliding_window_view(blocks, (count, count, count))
    return np.asarray(windows.sum(axis=(3, 4, 5)))
