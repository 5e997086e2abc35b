"""Calibration: the camera of every view, and how well it describes what was seen. Values only."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum

import numpy as np

from processing.calibration.errors import CalibrationError
from processing.calibration.target.targets import Target
from processing.geometry import FloatArray, ViewMapping


class Model(StrEnum):
    """How a view maps the world."""

    PINHOLE = "pinhole"
    PINHOLE_TILTED = "pinhole_tilted"
    POLYNOMIAL = "polynomial"


class Verdict(StrEnum):
    """What a view is good for, by its hold-out error."""

    GOOD = "good"
    USABLE = "usable"
    WARN = "warn"
    REFUSE = "refuse"


@dataclass(frozen=True)
class PlaneError:
    """Back-projection errors (eq. 2) of one plane, level or board.

    Parameters
    ----------
    z_mm : float | None
        Its position; None for scattered points and boards in free poses.
    n_points : int
        Points that count.
    mean_error_px, rms_px : float
        Mean and root mean square of the distances.
    name : str
        Name of the image, board or level.
    max_error_px : float | None
        Largest distance; None in files from before it was kept.
    holdout_error_px : float | None
        Mean error of its points when the fit had not seen them; None likewise.
    """

    z_mm: float | None
    n_points: int
    mean_error_px: float
    rms_px: float
    name: str
    max_error_px: float | None = None
    holdout_error_px: float | None = None


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
    rotation: FloatArray
    translation_mm: FloatArray


@dataclass(frozen=True, eq=False)
class ParameterCovariance:
    """How well the parameters of a fit are determined.

    Parameters
    ----------
    names : tuple[str, ...]
        The P parameters, with units.
    root : (P, P) array
        The covariance is ``root @ root.T``.
    """

    names: tuple[str, ...]
    root: FloatArray

    @property
    def std(self) -> dict[str, float]:
        """Standard deviation by parameter."""
        return dict(zip(self.names, np.linalg.norm(self.root, axis=1).tolist(), strict=True))


@dataclass(frozen=True, eq=False)
class ViewCalibration:
    """One view.

    Parameters
    ----------
    mapping : ViewMapping
        World to image. With ``board_poses`` it is the camera alone, in its own coordinates.
    model : Model
        Kind of mapping.
    n_points, n_rejected : int
        Points that were used, and that were left out as wrong.
    mean_error_px, rms_px, max_error_px : float
        Back-projection error (eq. 2) of the used points.
    holdout_error_px : float
        Mean error of points that the fit had not seen; the figure to trust.
    planes : tuple[PlaneError, ...]
        Errors by plane.
    verdict : Verdict
        What the view is good for.
    extent_mm : tuple[tuple[float, float], ...]
        Convex outline (x, y) of the used points.
    board_poses : tuple[BoardPose, ...]
        Poses of the boards, where the fit had to find them.
    covariance : ParameterCovariance | None
        Of the parameters of the mapping; None for boards in free poses, and after a correction.
    candidates_px : Mapping[Model, float]
        Where the model was chosen among several: the hold-out error of each, all on the same points.
    """

    mapping: ViewMapping
    model: Model
    n_points: int
    mean_error_px: float
    rms_px: float
    max_error_px: float
    holdout_error_px: float
    planes: tuple[PlaneError, ...]
    verdict: Verdict
    n_rejected: int = 0
    extent_mm: tuple[tuple[float, float], ...] = ()
    board_poses: tuple[BoardPose, ...] = ()
    covariance: ParameterCovariance | None = None
    candidates_px: Mapping[Model, float] = field(default_factory=dict)

    def with_boards(self, board_poses: tuple[BoardPose, ...]) -> "ViewCalibration":
        """The same with the poses of boards."""
        return replace(self, board_poses=board_poses)

    @property
    def worst_plane(self) -> PlaneError:
        """The plane with the largest mean error."""
        return max(self.planes, key=lambda plane: plane.mean_error_px)

    @property
    def intrinsics_only(self) -> bool:
        """The camera is known, its place in the world is not."""
        return bool(self.board_poses)


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
    """

    id: str
    created_utc: str
    target: Target | None
    views: Mapping[str, ViewCalibration]
    z_range_mm: tuple[float, float]
    source: str
    notes: tuple[str, ...] = ()
    parent: str | None = None

    def with_id(self, calibration_id: str) -> "Calibration":
        """The same under another id."""
        return replace(self, id=calibration_id)

    @property
    def x_range_mm(self) -> tuple[float, float]:
        """Range of calibrated points along x, over all views."""
        return self._range_mm(0)

    @property
    def y_range_mm(self) -> tuple[float, float]:
        """Range of calibrated points along y, over all views."""
        return self._range_mm(1)

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
