"""How accurate is a calibration? Against truth that only a simulation has, each figure beside its limit.

Cameras: the paper's target at its ten positions with 0.05 px of noise per coordinate, the principal point 250 px off
the middle, the lens distorted, and the sensor tilted as Scheimpflug asks; the error of the fit is measured all over
the volume. Corners: the paper's board rendered with blur, noise and uneven light, against where they truly are.
Drift: droplets of the spray itself tell of a camera that has moved by 2 px.
"""

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import cv2
import numpy as np

from processing.calibration.calibration import Model
from processing.calibration.errors import CalibrationError
from processing.calibration.joint_fit import calibrate
from processing.calibration.observation import CalibrationSet, PlaneObservation, ViewObservations
from processing.calibration.self_calibration import self_calibrate
from processing.calibration.targets import Target, detect_target
from processing.geometry import FloatArray, PinholeCamera, view_camera
from processing.studies.seen_droplets import droplet_calibration, droplet_views, seen_droplets
from processing.studies.simulated_droplets import AZIMUTHS_DEG, FOCAL_LENGTHS_MM, MAGNIFICATIONS, SCALE_VOXEL_PER_MM
from processing.synthetic.paper_rig import IMAGE_SIZE_PX, paper_cameras, paper_optics
from processing.synthetic.stamping import FloatImage
from processing.synthetic.target import Checkerboard, render_target

TARGET = Target(kind="checkerboard", columns=23, rows=17, pitch_mm=1.0)
HALF_VOLUME_MM = np.array([9.0, 8.625, 4.5])
DISTORTION = (0.6, 20.0, 8e-4, -6e-4, 0.0)
TRUE_ERROR_LIMIT_PX, CORNER_LIMIT_PX, CORNER_LIMIT_S, DRIFT_LIMIT_PX = 0.01, 0.05, 1.0, 0.1


@dataclass(frozen=True)
class Photograph:
    """How a rendered board was photographed.

    Parameters
    ----------
    blur_px : float
        Standard deviation of blur on top of diffraction and defocus.
    noise : float
        Standard deviation, relative to full scale.
    unevenness : float
        By how much the light falls off towards a corner.
    """

    blur_px: float = 0.0
    noise: float = 0.002
    unevenness: float = 0.0


PHOTOGRAPHS: Mapping[str, Photograph] = MappingProxyType(
    {
        "sharp": Photograph(),
        "blur 1.5 px": Photograph(blur_px=1.5),
        "noise 1 %": Photograph(noise=0.01),
        "uneven light": Photograph(unevenness=0.8),
        "blur, noise and uneven light": Photograph(1.5, 0.01, 0.8),
    }
)


@dataclass(frozen=True)
class CalibrationStudy:
    """What to measure; the defaults are the paper's rig.

    Parameters
    ----------
    views : tuple of str
        Views to measure; all four see the droplets.
    z_mm : tuple of float
        Positions of the target.
    noise_px : float
        Noise of corners, per coordinate.
    principal_offset_px : tuple[float, float]
        How far the optical axis lies from the middle of the image; to the other side in views from the other side.
    binning : int
        Of the rendered boards; 1 is the paper's resolution.
    photographs : tuple of str
        Names of ``PHOTOGRAPHS``.
    half_mm : tuple[float, float, float]
        Half-widths of the box with droplets; the paper's volume is 9 mm deep.
    densities_per_mm3 : tuple of float
        Of droplets.
    shots : int
        Shots of droplets.
    drift_px : float
        How far one camera has moved.
    seed : int
        Of all noise.
    """

    views: tuple[str, ...] = ("view1", "view2", "view3", "view4")
    z_mm: tuple[float, ...] = tuple(float(z) for z in np.linspace(-4.5, 4.5, 10))
    noise_px: float = 0.05
    principal_offset_px: tuple[float, float] = (250.0, -100.0)
    binning: int = 1
    photographs: tuple[str, ...] = tuple(PHOTOGRAPHS)
    half_mm: tuple[float, float, float] = (2.5, 2.0, 4.5)
    densities_per_mm3: tuple[float, ...] = (3.5, 7.0)
    shots: int = 4
    drift_px: float = 2.0
    seed: int = 0


@dataclass(frozen=True)
class AccuracyRow:
    """One figure of one view.

    Parameters
    ----------
    quantity : str
        What was measured: ``true error``, ``corner error``, ``corner time`` or ``drift error``.
    case : str
        Model, photograph, or density of droplets.
    view : str
        Name of the view.
    value : float | None
        Root mean square of this view in px, or CPU time in s; None where the product refused.
    maximum : float | None
        Largest error in px, of a drift in any view; None for times and refusals.
    limit : float
        What the value, of a drift the largest error, must not exceed.
    kept : bool
        Whether it does not.
    """

    quantity: str
    case: str
    view: str
    value: float | None
    maximum: float | None
    limit: float
    kept: bool


def calibration_study(study: CalibrationStudy | None = None) -> Iterator[AccuracyRow]:
    """Measure view by view; the same study gives the same errors (times differ)."""
    study = study or CalibrationStudy()
    yield from _fitted_cameras(study)
    yield from _found_corners(study)
    yield from _recovered_drifts(study)


def tilted_cameras(study: CalibrationStudy, *, tilted: bool) -> dict[str, PinholeCamera]:
    """The four views with their optical axes off the middle; where tilted, by the Scheimpflug condition."""
    cameras = {}
    for number, azimuth_deg in enumerate(AZIMUTHS_DEG):
        u_px, v_px = study.principal_offset_px
        camera = view_camera(
            azimuth_deg,
            focal_length_mm=FOCAL_LENGTHS_MM[number],
            magnification=MAGNIFICATIONS[number],
            scale_px_per_mm=SCALE_VOXEL_PER_MM,
            image_size_px=IMAGE_SIZE_PX,
            distortion=np.array(DISTORTION),
            principal_offset_px=(float(np.copysign(u_px, azimuth_deg)), v_px),
        )
        scheimpflug_rad = float(np.arctan(MAGNIFICATIONS[number] * np.tan(np.deg2rad(azimuth_deg))))
        cameras[f"view{number + 1}"] = replace(camera, tilt_rad=(0.0, scheimpflug_rad)) if tilted else camera
    return cameras


def _fitted_cameras(study: CalibrationStudy) -> Iterator[AccuracyRow]:
    points_mm = np.random.default_rng(study.seed).uniform(-HALF_VOLUME_MM, HALF_VOLUME_MM, (4000, 3))
    for model in (Model.PINHOLE, Model.PINHOLE_TILTED):
        cameras = tilted_cameras(study, tilted=model is Model.PINHOLE_TILTED)
        for number, view in enumerate(study.views):
            camera = cameras[view]
            planes = _noisy_planes(study, camera, np.random.default_rng([study.seed, number]))
            seen = {view: ViewObservations(camera.image_size_px, planes)}
            fitted = calibrate(CalibrationSet("study", TARGET, seen), model).views[view].mapping
            error_px = np.linalg.norm(fitted.project(points_mm) - camera.project(points_mm), axis=1)
            yield _row("true error", model.value, view, error_px, TRUE_ERROR_LIMIT_PX)


def _noisy_planes(
    study: CalibrationStudy, camera: PinholeCamera, rng: np.random.Generator
) -> tuple[PlaneObservation, ...]:
    board_mm = TARGET.points_mm(TARGET.board_ids())
    planes = []
    for z_mm in study.z_mm:
        points_mm = np.column_stack([board_mm, np.full(len(board_mm), z_mm)])
        image_px = camera.project(points_mm) + rng.normal(0, study.noise_px, (len(points_mm), 2))
        planes.append(PlaneObservation(f"z={z_mm:g}", points_mm, image_px, z_mm))
    return tuple(planes)


def _found_corners(study: CalibrationStudy) -> Iterator[AccuracyRow]:
    board = Checkerboard(TARGET.columns or 0, TARGET.rows or 0, TARGET.pitch_mm)
    for number, view in enumerate(study.views):
        camera = paper_cameras(study.binning)[view]
        z_mm = study.z_mm[number % 2 - 1]
        clear = render_target(camera, board, z_mm, paper_optics(study.binning)[view])
        for case in study.photographs:
            image = _photograph(clear, PHOTOGRAPHS[case], np.random.default_rng([study.seed, number]))
            started_s = time.process_time()
            points = detect_target(image, TARGET)
            seconds = time.process_time() - started_s
            world_mm = np.column_stack([TARGET.points_mm(points.ids), np.full(len(points), z_mm)])
            error_px = np.linalg.norm(points.image_px - camera.project(world_mm), axis=1)
            yield _row("corner error", case, view, error_px, CORNER_LIMIT_PX)
            yield AccuracyRow("corner time", case, view, seconds, None, CORNER_LIMIT_S, seconds < CORNER_LIMIT_S)


def _photograph(clear: FloatImage, how: Photograph, rng: np.random.Generator) -> FloatImage:
    """12-bit image of a board; blur as given, light that falls off to one corner, noise."""
    blurred = cv2.GaussianBlur(clear, (0, 0), how.blur_px) if how.blur_px else clear
    v, u = np.mgrid[0 : 1 : clear.shape[0] * 1j, 0 : 1 : clear.shape[1] * 1j]
    light = 1 - how.unevenness * (u * u + v * v) / 2
    image = rng.normal(3000 * light * blurred + 100, 4095 * how.noise)
    return np.asarray(np.clip(np.rint(image), 0, 4095), dtype=np.float32)


def _recovered_drifts(study: CalibrationStudy) -> Iterator[AccuracyRow]:
    half_mm = np.array(study.half_mm)
    cameras = droplet_views(_image_size_px(half_mm))
    calibration = droplet_calibration(cameras, half_mm)
    points_mm = np.random.default_rng(study.seed).uniform(-half_mm, half_mm, (1000, 3))
    drift_px = study.drift_px * np.array([np.sqrt(0.5), -np.sqrt(0.5)])
    for density_per_mm3 in study.densities_per_mm3:
        rng = np.random.default_rng(study.seed)
        shots = [seen_droplets(cameras, half_mm, density_per_mm3, rng) for _ in range(study.shots)]
        for name in study.views:
            moved, case = list(calibration.views).index(name), f"{density_per_mm3:g} droplets/mm3"
            shifts_px = np.zeros((len(cameras), 2))
            shifts_px[moved] = drift_px
            drifted = [[seen + shift for seen, shift in zip(shot, shifts_px, strict=True)] for shot in shots]
            try:
                found = self_calibrate(calibration, drifted, "study").calibration
            except CalibrationError:
                yield AccuracyRow("drift error", case, name, None, None, DRIFT_LIMIT_PX, kept=False)
                continue
            error_px = [
                np.linalg.norm(view.mapping.project(points_mm) - camera.project(points_mm) - shift, axis=1)
                for view, camera, shift in zip(found.views.values(), cameras, shifts_px, strict=True)
            ]
            largest_px = float(np.max(error_px))
            kept = largest_px <= DRIFT_LIMIT_PX
            yield AccuracyRow("drift error", case, name, _rms(error_px[moved]), largest_px, DRIFT_LIMIT_PX, kept)


def _image_size_px(half_mm: FloatArray) -> tuple[int, int]:
    """Image in which every view sees the whole box of half-widths (3,), with a margin for perspective."""
    x_mm, y_mm, z_mm = 2.2 * half_mm
    return round(SCALE_VOXEL_PER_MM * float(np.hypot(x_mm, z_mm))), round(SCALE_VOXEL_PER_MM * float(y_mm))


def _row(quantity: str, case: str, view: str, error_px: FloatArray, limit_px: float) -> AccuracyRow:
    rms_px = _rms(error_px)
    return AccuracyRow(quantity, case, view, rms_px, float(error_px.max()), limit_px, rms_px <= limit_px)


def _rms(error_px: FloatArray) -> float:
    return float(np.sqrt((error_px**2).mean()))


def of_quantity(rows: Sequence[AccuracyRow], quantity: str) -> list[AccuracyRow]:
    """Rows of one quantity."""
    return [row for row in rows if row.quantity == quantity]
