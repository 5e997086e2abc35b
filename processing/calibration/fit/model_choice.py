"""Which model describes a view: the simplest one, unless another predicts unseen points clearly better."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from processing.calibration.calibration import Model
from processing.calibration.errors import UNFIT, CalibrationError
from processing.calibration.fit.health import holdout_distances_px
from processing.calibration.fit.pinhole_fit import fit_pinhole
from processing.calibration.fit.polynomial import fit_polynomial
from processing.calibration.observation import PlaneObservation, stacked
from processing.geometry import FloatArray, ViewMapping

Result = TypeVar("Result")

AUTO: Literal["auto"] = "auto"
"""Instead of the name of a model: choose by hold-out error."""
SIMPLEST_FIRST = (Model.PINHOLE, Model.PINHOLE_TILTED, Model.POLYNOMIAL)
CLEARLY_BETTER = 0.95
"""A model that is less simple must lower the hold-out error at least to this part of it."""
NOTHING_TOLD = 0.25
"""A mapping that leaves so much of how far points are spread in the image is none."""
SIGNIFICANCE = 3.0
"""And by so many standard errors of the difference, point by point: few points tell little."""


def fit_mapping(
    planes: Sequence[PlaneObservation], image_size_px: tuple[int, int], model: Model
) -> tuple[ViewMapping, NDArray[np.bool_]]:
    """Fit one mapping to all points of a view; also which of them (N,) it was fitted to.

    Raises
    ------
    CalibrationError
        There are too few points, or the best mapping hardly tells them apart.
    """
    points_mm, image_px = stacked(planes)
    mapping, used = _fit(points_mm, image_px, image_size_px, model)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        missed_px = float((mapping.project(points_mm[used]) - image_px[used]).std(axis=0).max())
    if not missed_px < NOTHING_TOLD * image_px[used].std(axis=0).max():
        raise CalibrationError(UNFIT)
    return mapping, used


def _fit(
    points_mm: FloatArray, image_px: FloatArray, image_size_px: tuple[int, int], model: Model
) -> tuple[ViewMapping, NDArray[np.bool_]]:
    if model is Model.POLYNOMIAL:
        return fit_polynomial(points_mm, image_px, image_size_px)
    fitted = fit_pinhole(points_mm, image_px, image_size_px, tilted=model is Model.PINHOLE_TILTED)
    return fitted.camera, fitted.used


def holdout_by_model(planes: Sequence[PlaneObservation], image_size_px: tuple[int, int]) -> dict[Model, FloatArray]:
    """Errors (N,) of the same held-out points by every model that these planes can determine, simplest first.

    Points count that at least one model was fitted to: a model that leaves out what it cannot describe gains
    nothing by it.

    Raises
    ------
    CalibrationError
        No model can be fitted.
    """
    used = dict(_of_those_that_can(lambda model: fit_mapping(planes, image_size_px, model)[1]))
    ends = np.cumsum([len(plane) for plane in planes])
    masks = np.split(np.any(list(used.values()), axis=0), ends[:-1])
    counted = [plane.select(mask) for plane, mask in zip(planes, masks, strict=True)]

    def distances_px(model: Model) -> FloatArray:
        return np.concatenate(
            holdout_distances_px(counted, lambda training: fit_mapping(training, image_size_px, model)[0])
        )

    return dict(_of_those_that_can(distances_px, tuple(used)))


def _of_those_that_can(
    do: Callable[[Model], Result], models: Sequence[Model] = SIMPLEST_FIRST
) -> Iterator[tuple[Model, Result]]:
    """What each model makes of it; the simplest one's complaint where none can."""
    problems, done = [], 0
    for model in models:
        try:
            result = do(model)
        except CalibrationError as error:
            problems.append(error)
            continue
        done += 1
        yield model, result
    if not done:
        raise problems[0]


def simplest_that_holds(distances_px: Mapping[Model, FloatArray]) -> Model:
    """The model to take, from the errors (N,) of the same held-out points by each, simplest first."""
    chosen, *others = distances_px
    for model in others:
        if _clearly_better(distances_px[model], distances_px[chosen]):
            chosen = model
    return chosen


def _clearly_better(one_px: FloatArray, other_px: FloatArray) -> bool:
    gain_px = other_px - one_px
    significant = gain_px.mean() > SIGNIFICANCE * gain_px.std() / np.sqrt(len(gain_px))
    return bool(significant and one_px.mean() < CLEARLY_BETTER * other_px.mean())
