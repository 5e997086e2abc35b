"""Calibration: the camera of every view, and how well it describes what was seen. Values only.

Views stand in a calibration file as they are here: names and order of their fields are those of the file.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Annotated

import numpy as np
from pydantic import ConfigDict, Field, with_config

from processing.calibration.errors import CalibrationError
from processing.calibration.stored_fields import Matrix, Square, StoredMapping, Vector
from processing.calibration.target.targets import Target
from processing.calibration.verdict import Doubt, Unchecked, Verdict, worse

Count = Annotated[int, Field(ge=0)]
ErrorPx = Annotated[float, Field(ge=0)]
_STRICT = ConfigDict(extra="forbid", allow_inf_nan=False)


class Model(StrEnum):
    """How a view maps the world."""

    PINHOLE = "pinhole"
    PINHOLE_TILTED = "pinhole_tilted"
    POLYNOMIAL = "polynomial"


@with_config(_STRICT)
@dataclass(frozen=True)
class PlaneError:
    """Back-projection errors (eq. 2) of one plane, level or board.

    Parameters
    ----------
    name : str
        Name of the image, board or level.
    z_mm : float | None
        Its position; None for scattered points and boards in free poses.
    n_points : int
        Points that count.
    mean_error_px, rms_px : float
        Mean and root mean square of the distances.
    max_error_px : float | None
        Largest distance; None in files from before it was kept.
    holdout_error_px : float | None
        Mean error of its points when the fit had not seen them; None likewise.
    """

    name: str
    z_mm: float | None
    n_points: Count
    mean_error_px: ErrorPx
    rms_px: ErrorPx
    max_error_px: ErrorPx | None = None
    holdout_error_px: ErrorPx | None = None


@with_config(_STRICT)
@dataclass(frozen=True, eq=False)
class BoardPose:
    """Where the fit found a board that stood in a free pose, in camera coordinates.

    Parameters
    ----------
    name : str
        Name of the board.
    rotation : (3, 3) array
        Board to camera.
    translation_mm : (3,) array
        Origin of the board.
    """

    name: str
    rotation: Matrix
    translation_mm: Vector


@with_config(_STRICT)
@dataclass(frozen=True, eq=False)
class ParameterCovariance:
    """How well the parameters of a fit are determined.

    Parameters
    ----------
    parameters : tuple[str, ...]
        Names of the P parameters, with units.
    root : (P, P) array
        The covariance is ``root @ root.T``.
    """

    parameters: tuple[str, ...]
    root: Square

    def __post_init__(self) -> None:
        if len(self.root) != len(self.parameters):
            raise ValueError("root: one row and one column for every parameter")

    @property
    def std(self) -> dict[str, float]:
        """Standard deviation by parameter."""
        return dict(zip(self.parameters, np.linalg.norm(self.root, axis=1).tolist(), strict=True))


@with_config(_STRICT)
@dataclass(frozen=True, eq=False, kw_only=True)
class ViewCalibration:
    """One view.

    Parameters
    ----------
    verdict : Verdict
        What the view is good for.
    model : Model
        Kind of mapping.
    n_points, n_rejected : int
        Points that were used, and that were left out as wrong.
    mean_error_px, rms_px, max_error_px : float
        Back-projection error (eq. 2) of the used points.
    holdout_error_px : float
        Mean error of points that the fit had not seen; the figure to trust.
    mapping : ViewMapping
        World to image. With ``boards_in_free_poses`` it is the camera alone, in its own coordinates.
    extent_mm : tuple[tuple[float, float], ...]
        Convex outline (x, y) of the used points.
    boards_in_free_poses : tuple[BoardPose, ...]
        Poses of the boards, where the fit had to find them.
    planes : tuple[PlaneError, ...]
        Errors by plane.
    covariance : ParameterCovariance | None
        Of the parameters of the mapping; None for boards in free poses, and after a correction.
    candidates_holdout_error_px : Mapping[Model, float]
        Where the model was chosen among several: the hold-out error of each, all on the same points.
    reasons : tuple[str, ...]
        Why the verdict is not better than it is.
    rays_miss_px : float | None
        Median distance between where the view sees points of the target and where all views put them, if others do.
    """

    verdict: Verdict
    model: Model
    n_points: Count
    n_rejected: Count
    mean_error_px: ErrorPx
    rms_px: ErrorPx
    max_error_px: ErrorPx
    holdout_error_px: ErrorPx
    mapping: StoredMapping
    extent_mm: tuple[tuple[float, float], ...]
    boards_in_free_poses: tuple[BoardPose, ...]
    planes: tuple[PlaneError, ...]
    covariance: ParameterCovariance | None = None
    candidates_holdout_error_px: Mapping[Model, ErrorPx] = field(default_factory=dict)
    reasons: tuple[str, ...] = ()
    rays_miss_px: ErrorPx | None = None

    def doubted(self, doubt: Doubt) -> "ViewCalibration":
        """The same with a verdict that is no better than a doubt leaves it."""
        return replace(self, verdict=worse(self.verdict, doubt.verdict), reasons=(*self.reasons, doubt.text))

    @property
    def worst_plane(self) -> PlaneError:
        """The plane with the largest mean error."""
        return max(self.planes, key=lambda plane: plane.mean_error_px)

    @property
    def intrinsics_only(self) -> bool:
        """The camera is known, its place in the world is not."""
        return bool(self.boards_in_free_poses)


@dataclass(frozen=True, eq=False)
class Calibration:
    """All views of one target.

    Parameters
    ----------
    id : str
        Derived from the content: the same fit of the same points has the same id.
    created_utc : str
        ISO 8601.
    target : Target | None
        What was looked at; None for points measured elsewhere.
    views : Mapping[str, ViewCalibration]
        By view name.
    z_range_mm : tuple[float, float]
        Range along z that every view is calibrated for; (0, 0) where only intrinsics are known.
    source : str
        Run or set it was made from.
    notes : tuple[str, ...]
        Images that were left out, and why.
    parent : str | None
        Id of the calibration that this one corrects.
    not_checked : tuple[Unchecked, ...]
        What may be wrong without showing, as nothing was stated that would tell.
    """

    id: str
    created_utc: str
    target: Target | None
    views: Mapping[str, ViewCalibration]
    z_range_mm: tuple[float, float]
    source: str
    notes: tuple[str, ...] = ()
    parent: str | None = None
    not_checked: tuple[Unchecked, ...] = ()

    def with_id(self, calibration_id: str) -> "Calibration":
        """The same under another id."""
        return replace(self, id=calibration_id)

    def doubted(self, doubts: Iterable[Doubt]) -> "Calibration":
        """The same with the verdicts that doubts leave; each is a note too."""
        views, notes = dict(self.views), list(self.notes)
        for doubt in doubts:
            notes.append(doubt.text)
            views.update({name: views[name].doubted(doubt) for name in doubt.views})
        return replace(self, views=views, notes=tuple(notes))

    @property
    def x_range_mm(self) -> tuple[float, float]:
        """Range of calibrated points along x, over all views."""
        return self._range_mm(0)

    @property
    def y_range_mm(self) -> tuple[float, float]:
        """Range of calibrated points along y, over all views."""
        return self._range_mm(1)

    def require_usable(self, names: Iterable[str]) -> None:
        """Refuse to reconstruct from views that are unknown, not placed or refused.

        Raises
        ------
        CalibrationError
            One of these views is.
        """
        names = list(names)
        if unknown := sorted(set(names) - set(self.views)):
            raise CalibrationError(f"views {unknown} are not in calibration {self.id}, it has {sorted(self.views)}")
        self.require_world()
        for name in names:
            view = self.views[name]
            if view.verdict is Verdict.REFUSE:
                reason = "; ".join(view.reasons) or f"hold-out error {view.holdout_error_px:.3g} px"
                raise CalibrationError(f"calibration {self.id}, {name} is refused: {reason}")

    def require_world(self) -> None:
        """Refuse to reconstruct where nobody knows how the views stand to each other.

        Raises
        ------
        CalibrationError
            A view was calibrated on boards in free poses.
        """
        unplaced = sorted(name for name, view in self.views.items() if view.intrinsics_only)
        if unplaced:
            raise CalibrationError(
                f"calibration {self.id}: {', '.join(unplaced)}: boards stood in free poses, so only the intrinsics are "
                "known, not where the views stand; reconstruction needs planes at known z_mm"
            )

    def _range_mm(self, axis: int) -> tuple[float, float]:
        self.require_world()
        values_mm = np.array([point[axis] for view in self.views.values() for point in view.extent_mm])
        return float(values_mm.min()), float(values_mm.max())
