"""Back-projection error of a calibration, plane by plane (Fig. 3 of the paper).

The target is rendered as each view sees it, with blur, uneven light, dust and noise; the product's detector finds
its corners, and ``calibrate`` fits the view. Beside it stands what the same fit makes of ideal points of an ideal
pinhole camera: the error that is left when nothing is wrong.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from operator import attrgetter

import numpy as np
from matplotlib.figure import Figure

from processing.calibration.calibrate import calibrate
from processing.calibration.calibration import Calibration, Model
from processing.calibration.observation import CalibrationSet, PlaneObservation, ViewObservations
from processing.calibration.sets.plane_detection import place_points
from processing.calibration.target.targets import Target, detect_target
from processing.figures.curve import Curve
from processing.figures.residual_figures import PAPER_LIMIT_PX, detection_residuals_figure
from processing.geometry import FloatArray, PinholeCamera
from processing.studies.report import Statement, grouped
from processing.synthetic.paper_rig import paper_cameras, paper_optics
from processing.synthetic.scene import NOMINAL_WIDTH_NS, Scene, SceneKind
from processing.synthetic.target import Checkerboard

BITS = 12


class PointSource(StrEnum):
    """Where the points of a calibration come from."""

    DETECTED = "detected"
    """Found in rendered images of distorted cameras."""
    IDEAL = "ideal"
    """Projected by the same cameras without distortion, exactly."""


@dataclass(frozen=True)
class ResidualStudy:
    """What to calibrate; target and planes are the paper's.

    Parameters
    ----------
    z_mm : tuple of float
        Positions of the target.
    columns, rows, pitch_mm : int, int, float
        Inner corners of the checkerboard, and their distance.
    views : tuple of str
        Of the paper's rig. Its Fig. 3 shows view 2.
    binning : int
        Of the rendered images; 1 is the paper's resolution.
    seed : int
        Of light, dust and noise.
    """

    z_mm: tuple[float, ...] = tuple(float(z) for z in np.linspace(-4.5, 4.5, 10))
    columns: int = 23
    rows: int = 17
    pitch_mm: float = 1.0
    views: tuple[str, ...] = ("view1", "view2", "view3", "view4")
    binning: int = 1
    seed: int = 0

    @property
    def target(self) -> Target:
        """What the detector looks for."""
        return Target(kind="checkerboard", columns=self.columns, rows=self.rows, pitch_mm=self.pitch_mm)


@dataclass(frozen=True)
class ResidualRow:
    """One point of Fig. 3: errors (eq. 2) of a plane, and the hold-out errors of plane and view."""

    view: str
    points: str
    z_mm: float
    n_points: int
    mean_error_px: float
    rms_px: float
    max_error_px: float | None
    holdout_error_px: float | None
    view_holdout_error_px: float


def residual_study(study: ResidualStudy | None = None) -> Iterator[ResidualRow]:
    """Calibrate view by view; yields the planes of each as soon as they are known. The same study, the same rows."""
    study = study or ResidualStudy()
    cameras = {view: paper_cameras(study.binning)[view] for view in study.views}
    for view, camera in cameras.items():
        ideal = replace(camera, distortion=np.zeros(5))
        yield from _rows(PointSource.DETECTED, _calibrated(study, view, camera, detected_planes(study, view, camera)))
        yield from _rows(PointSource.IDEAL, _calibrated(study, view, ideal, ideal_planes(study, ideal)))


def detected_planes(study: ResidualStudy, view: str, camera: PinholeCamera) -> Iterator[PlaneObservation]:
    """The corners that the detector finds in a rendered image of every plane."""
    stage_z_mm = 0.0
    optics = {view: paper_optics(study.binning)[view]}
    board = Checkerboard(study.columns, study.rows, study.pitch_mm)
    scene = Scene({view: camera}, optics, seed=study.seed, target=board, stage_z_mm=lambda: stage_z_mm)
    scene.prepare(SceneKind.CALIBRATION)
    width_px, height_px = camera.image_size_px
    pulse = (0, NOMINAL_WIDTH_NS, optics[view].nominal_current_a)
    for number, stage_z_mm in enumerate(study.z_mm):
        image = scene.render(view, number, "A", [pulse], (height_px, width_px), BITS)
        yield place_points(detect_target(image, study.target), study.target, f"z={stage_z_mm:g}", stage_z_mm)


def ideal_planes(study: ResidualStudy, camera: PinholeCamera) -> Iterator[PlaneObservation]:
    """The corners where a camera sees them, exactly."""
    board_mm = study.target.points_mm(study.target.board_ids())
    for z_mm in study.z_mm:
        points_mm: FloatArray = np.column_stack([board_mm, np.full(len(board_mm), z_mm)])
        yield PlaneObservation(f"z={z_mm:g}", points_mm, camera.project(points_mm), z_mm)


def _calibrated(
    study: ResidualStudy, view: str, camera: PinholeCamera, planes: Iterable[PlaneObservation]
) -> Calibration:
    seen = {view: ViewObservations(camera.image_size_px, tuple(planes))}
    return calibrate(CalibrationSet("study", study.target, seen), Model.PINHOLE)


def _rows(points: PointSource, calibration: Calibration) -> Iterator[ResidualRow]:
    for name, view in calibration.views.items():
        for plane in view.planes:
            z_mm = plane.z_mm or 0.0
            yield ResidualRow(
                view=name,
                points=points.value,
                z_mm=z_mm,
                n_points=plane.n_points,
                mean_error_px=plane.mean_error_px,
                rms_px=plane.rms_px,
                max_error_px=plane.max_error_px,
                holdout_error_px=plane.holdout_error_px,
                view_holdout_error_px=view.holdout_error_px,
            )


def residual_statements(rows: Sequence[ResidualRow]) -> list[Statement]:
    """The worst plane of every view beside the paper's limit."""
    return [
        Statement(
            f"{view}, {points}: mean back-projection error of the worst plane",
            f"< {PAPER_LIMIT_PX} px",
            f"{max(row.mean_error_px for row in chosen):.2g} px (hold-out {chosen[0].view_holdout_error_px:.2g} px)",
        )
        for (view, points), chosen in grouped(rows, attrgetter("view", "points")).items()
    ]


def residual_figure(rows: Sequence[ResidualRow]) -> Figure:
    """Mean back-projection error of every plane, by view and by source of the points."""
    detected, ideal = (
        [
            Curve(view, [row.z_mm for row in curve], [row.mean_error_px for row in curve])
            for (view, points), curve in grouped(rows, attrgetter("view", "points")).items()
            if points == source
        ]
        for source in PointSource
    )
    return detection_residuals_figure(detected, ideal)
