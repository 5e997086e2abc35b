"""How close a line of sight has to come to the textbook, voxel by voxel."""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from processing.reconstruction.choices import ReconstructionMethod
from processing.reconstruction.planning.fixed_point import FixedPoint
from processing.reconstruction.planning.node_view import NodeView
from processing.reconstruction.planning.plan import Plan
from processing.reconstruction.planning.rectified_view import RectifiedView
from tests.support import oracle
from tests.support.sight_cases import Images

ROUNDING = {"float32": (0.0, 0.0), "float16": (2.0**-11, 2.0**-25), "uint8": (0.0, 0.5 / 255)}
"""Of the numbers in a volume: relative, and absolute."""
ARITHMETIC = 32 * 2.0**-24
"""Eight samples with their factors, and the root of their product, in single precision."""


def assert_equals_textbook(volume: NDArray[Any], plan: Plan, images: Images, method: ReconstructionMethod) -> None:
    """Every voxel lies between what it would be if all samples were smaller, or larger, by all that rounding does.

    That bites wherever no view sees almost nothing, for roots of many samples as well as for products.
    """
    resampled = plan.resample(images)
    samples = oracle.planned_samples(plan, resampled)
    errors = [sample_error(view, image) for view, image in zip(plan.views, resampled, strict=True)]
    least = oracle.combine([np.maximum(s - error, 0) for s, error in zip(samples, errors, strict=True)], method)
    most = oracle.combine([s + error for s, error in zip(samples, errors, strict=True)], method)
    relative, absolute = ROUNDING[volume.dtype.name]
    values = volume.astype(float) / (255 if volume.dtype == np.uint8 else 1)
    assert np.all(values >= least * (1 - relative - ARITHMETIC) - absolute - ARITHMETIC)
    assert np.all(values <= most * (1 + relative + ARITHMETIC) + absolute + ARITHMETIC)
    assert not values[sees_nothing(plan, resampled)].any()


def sample_error(view: RectifiedView | NodeView, image: FixedPoint) -> float:
    """Rectified: three counts, see windows.hpp. By nodes: one for the weights, and what rounding does to positions.

    These are rounded four times by half of their last place, along two axes; no pixel differs from the next by more
    than the brightest.
    """
    counts = 3.0
    if isinstance(view, NodeView):
        counts = 1 + 32767 * 2 * 4 * 0.5 * float(np.spacing(np.float32(max(view.shape_px))))
    return counts * image.unit


def sees_nothing(plan: Plan, resampled: list[FixedPoint]) -> NDArray[np.bool_]:
    """Voxels at which a view sees nothing within a pixel: they are zero, whatever the rounding."""
    around = np.ones((3, 3), np.uint8)
    seen = [
        oracle.bilinear(
            cv2.dilate(image.intensity, around).astype(np.float32), *oracle.planned_positions(view, plan.grid)
        )
        for view, image in zip(plan.views, resampled, strict=True)
    ]
    return np.asarray(np.min(seen, axis=0) == 0)
