"""Reconstruction on images by the names of their views, so that none can be taken for another.

The kernels take images in the order of a plan (``processing.reconstruction``); here they are asked for by name.
"""

import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from processing import preprocessing
from processing.calibration.calibration import Calibration
from processing.count import require_count
from processing.grey_image import require_image, require_intensities
from processing.kernels import DEFAULT_THREADS
from processing.light import dim_light, odd_light
from processing.masked import require_unmasked
from processing.preprocessing import Intensity, Polarity, Preprocessing
from processing.reconstruction import smart as iterative
from processing.reconstruction.choices import Accuracy, ReconstructionMethod
from processing.reconstruction.line_of_sight import line_of_sight
from processing.reconstruction.planning.calibrated_plan import calibrated_plan, default_grid, told_coarse
from processing.reconstruction.planning.plan import Plan
from processing.reconstruction.smart import SmartResult
from processing.volume import VoxelGrid

Volume = NDArray[np.float32]
Images = Mapping[str, Intensity]


def common_grid(calibration: Calibration, pitch_mm: float | None = None) -> VoxelGrid:
    """The largest box that all views see within the calibrated range; x and y reach a quarter beyond the target.

    Parameters
    ----------
    calibration : Calibration
        Of all views.
    pitch_mm : float, optional
        Voxel edge; by default one pixel of the finest view in the middle of the volume.

    Raises
    ------
    ReconstructionError
        The views have no volume in common.
    """
    return default_grid(calibration, pitch_mm)


def plan(
    calibration: Calibration,
    grid: VoxelGrid,
    views: Sequence[str] | None = None,
    *,
    accuracy: Accuracy | str = Accuracy.NOMINAL,
) -> Plan:
    """Where every view sees every voxel: all that does not depend on the images. Made once, used for every shot.

    Parameters
    ----------
    calibration : Calibration
        Of all views.
    grid : VoxelGrid
        The volume to reconstruct, see ``common_grid``; a slice or a region of interest is a grid of its own.
    views : sequence of str, optional
        Which views to use, two to eight; by default all of the calibration.
    accuracy : {"nominal", "fine"}
        How finely views are resampled: fine is two to three times more accurate, at twice the cost.

    Returns
    -------
    Plan
        ``grid``, ``names`` of the views, and ``deviation_px``, what the plan adds to the error of the calibration.

    Raises
    ------
    CalibrationError
        A view is not in the calibration or was refused, or the calibration has no common world.
    ReconstructionError
        Too few or too many views, or a mapping too rough to be sampled.
    ValueError
        A view is named twice.

    Warns
    -----
    UserWarning
        Voxels are so wide that droplets are missed between them.
    """
    names = tuple(calibration.views if views is None else views)
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise ValueError(f"views {', '.join(twice)} are named twice; each sees the volume once")
    calibration.require_usable(names)
    planned = calibrated_plan(calibration, grid, names, Accuracy(accuracy))
    if coarse := told_coarse(calibration, grid, names):
        warnings.warn(coarse, stacklevel=2)
    return planned


def intensity(
    frame: preprocessing.Frame,
    *,
    bits: int,
    polarity: Polarity = "shadow",
    background: Intensity | None = None,
    dark: Intensity | None = None,
    minimum_window_px: int = Preprocessing.minimum_window_px,
    noise_floor: float = Preprocessing.noise_floor,
) -> Intensity:
    """From grey values to the share of light that is missing: divide by the background, invert, subtract the slow part.

    Parameters
    ----------
    frame : (rows, columns) uint8 or uint16 array
        Grey values of one exposure.
    bits : int
        Significant bits of a grey value: 12 for 12-bit values in 16-bit files.
    polarity : {"shadow", "bright"}
        Dark droplets before a lit background, or bright particles on black.
    background, dark : (rows, columns) array, optional
        Mean image with light but without spray, and without light, in grey values of the same exposure (A or B).
        Without a background the light is estimated from the frame itself.
    minimum_window_px : int
        Edge of the sliding minimum, which takes away what varies slowly; larger than the largest structure, as a
        larger one loses its middle. 0 leaves it out.
    noise_floor : float
        Subtracted from every pixel, so that noise does not become droplets; 0 to 1.

    Returns
    -------
    (rows, columns) float32 array
        0 where the view is free, 1 where it is blocked.

    Raises
    ------
    ValueError
        A reference image has another shape than the frame or is not finite, the frame has other grey values than
        ``bits`` can hold or pixels that are masked, or bright particles have a background.

    Warns
    -----
    UserWarning
        The light of the frame does not fit its background, polarity or bits: the result looks fine, and is not.
    """
    require_count("minimum_window_px", minimum_window_px)
    if not 1 <= require_count("bits", bits, 1) <= 16 or (frame.size and int(frame.max()) >= 2**bits):
        raise ValueError(f"bits {bits} of 1 to 16 reach to {2**bits - 1}, a pixel is {frame.max(initial=0)}")
    for name, array in (("frame", frame), ("background", background), ("dark", dark)):
        if array is not None:
            require_image(name, array)
    if polarity == "bright" and background is not None:
        raise ValueError("bright particles are before no light: subtract what there is without them as dark")
    dark, background = (None if one is None else np.ascontiguousarray(one, np.float32) for one in (dark, background))
    result = preprocessing.intensity(
        frame, Preprocessing(polarity, minimum_window_px, noise_floor), bits=bits, dark=dark, background=background
    )
    odd = odd_light(frame, polarity, bits=bits, dark=dark, background=background)
    for what in filter(None, (odd, dim_light(frame, bits))):
        warnings.warn(f"the image {what}", stacklevel=2)
    return result


def mlos(plan: Plan, images: Images, *, out: NDArray[Any] | None = None, threads: int = DEFAULT_THREADS) -> Volume:
    """MLOS: every voxel is the product of what the views see where it is projected to (eq. 8).

    Parameters
    ----------
    plan : Plan
        Geometry of views and grid.
    images : mapping of view to (rows, columns) float32 array
        Intensities, 0 to 1; see ``intensity``.
    out : (z, y, x) float32, float16 or uint8 array, optional
        Receives the volume; 255 is 1 where it is of bytes. Reused memory is much faster than new.
    threads : int
        The result does not depend on it.

    Returns
    -------
    (z, y, x) array
        ``out``, or a new float32 volume.

    Raises
    ------
    ValueError
        Images or ``out`` do not fit the plan.

    Warns
    -----
    UserWarning
        An image can be none of intensities: it reaches far above 1, or most of it is blocked.
    """
    return _by_sight(ReconstructionMethod.MLOS, plan, images, out, threads)


def minlos(plan: Plan, images: Images, *, out: NDArray[Any] | None = None, threads: int = DEFAULT_THREADS) -> Volume:
    """MINLOS: every voxel is the minimum of what the views see where it is projected to. All else as ``mlos``."""
    return _by_sight(ReconstructionMethod.MINLOS, plan, images, out, threads)


def gavlos(plan: Plan, images: Images, *, out: NDArray[Any] | None = None, threads: int = DEFAULT_THREADS) -> Volume:
    """GAVLOS: every voxel is the geometric average of what the views see there. All else as ``mlos``."""
    return _by_sight(ReconstructionMethod.GAVLOS, plan, images, out, threads)


def _by_sight(
    method: ReconstructionMethod, plan: Plan, images: Images, out: NDArray[Any] | None, threads: int
) -> Volume:
    require_count("threads", threads, 1)
    return line_of_sight(plan, _in_order(plan, images), method, out, threads=threads)


def smart(
    plan: Plan,
    images: Images,
    *,
    iterations: int = 20,
    relaxation: float = 1.0,
    least_gain: float = 0.0,
    start: Volume | None = None,
    stop: Callable[[int, float], bool] | None = None,
    threads: int = DEFAULT_THREADS,
) -> SmartResult:
    """SMART: refine the volume until its projections agree with the images; all views correct it at once (eq. 9).

    Parameters
    ----------
    plan : Plan
        Geometry of views and grid.
    images : mapping of view to (rows, columns) float32 array
        Intensities, 0 to 1, not negative; see ``intensity``. A warning tells those that can be none.
    iterations : int
        At most so many; the paper found 20 to be enough.
    relaxation : float
        1 is the method of the paper; less converges slower and follows noise less.
    least_gain : float
        Stop after an iteration that lowered the residual by less than this share of it; 0 never does.
    start : (z, y, x) float32 array, optional
        First guess, not negative; by default MLOS. Where it is zero, the result is zero.
    stop : callable, optional
        Called with number of iterations done and residual; ends the iteration by returning True.
    threads : int
        The result does not depend on it.

    Returns
    -------
    SmartResult
        ``volume`` (z, y, x) float32, and ``residuals``: norm of projections minus images over norm of the images, of
        the start and after every iteration.

    Raises
    ------
    ValueError
        Images or ``start`` do not fit the plan, or an option is out of range.
    """
    require_unmasked("start", start)
    return iterative.smart(
        plan,
        _in_order(plan, images),
        iterations=iterations,
        relaxation=relaxation,
        least_gain=least_gain,
        start=start,
        stop=stop,
        threads=threads,
    )


def mart(
    plan: Plan,
    images: Images,
    *,
    iterations: int = 20,
    relaxation: float = 1.0,
    least_gain: float = 0.0,
    start: Volume | None = None,
    stop: Callable[[int, float], bool] | None = None,
    threads: int = DEFAULT_THREADS,
) -> SmartResult:
    """MART by views: one view after the other corrects the volume. All else as ``smart``."""
    require_unmasked("start", start)
    return iterative.mart(
        plan,
        _in_order(plan, images),
        iterations=iterations,
        relaxation=relaxation,
        least_gain=least_gain,
        start=start,
        stop=stop,
        threads=threads,
    )


def _in_order(plan: Plan, images: Images) -> list[Intensity]:
    """The images of the views in the order of the plan."""
    if set(images) != set(plan.names):
        raise ValueError(f"images of {sorted(images)}, the plan has views {sorted(plan.names)}")
    require_intensities(images)
    return [images[name] for name in plan.names]
