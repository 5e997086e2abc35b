"""``tomoshadow calibrate``: a camera for every view, and what its errors say."""

import re
from argparse import ArgumentTypeError, Namespace
from dataclasses import asdict
from typing import Any

import numpy as np

from processing.calibration.calibrate import calibrate
from processing.calibration.calibration import Calibration, Verdict, ViewCalibration
from processing.calibration.calibration_file import require_free, save_calibration
from processing.calibration.fit.covariance import worst_position_std_px
from processing.calibration.fit.placement import placement
from processing.calibration.sets.calibration_set import load_calibration_set
from processing.figures.volume_figures import residuals_figure
from server.cli.commands import NUMBER, picture_beside, progress
from server.pictures.calibration_pictures import calibration_pictures


def calibrate_views(options: Namespace) -> dict[str, Any]:
    """``tomoshadow calibrate``; it has not passed where a view is refused."""
    figure = picture_beside(options.out)
    require_free(options.out)
    calibration_set = load_calibration_set(options.set, dict(options.origin or ()), dict(options.roll or ()))
    calibration = calibrate(calibration_set, model=options.model)
    save_calibration(calibration, options.out)
    residuals_figure(calibration).savefig(figure, dpi=120)
    figures = calibration_pictures(options.set, calibration_set, calibration, options.out)
    for note in calibration.notes:
        progress(note)
    refused = {name: view for name, view in calibration.views.items() if view.verdict is Verdict.REFUSE}
    for name, view in refused.items():
        progress(
            f"{name}: REFUSED, hold-out error {view.holdout_error_px:.3g} px: reconstruction does not start with it"
        )
    return {
        "passed": not refused,
        "calibration": str(options.out),
        "id": calibration.id,
        "figure": str(figure),
        "figures": [str(picture) for picture in figures],
        "notes": list(calibration.notes),
        **view_errors(calibration),
    }


def stated_origin(text: str) -> tuple[tuple[str, float], tuple[float, float]]:
    """View, position in mm and image point of ``VIEW@Z=U,V``."""
    match = re.fullmatch(rf"(.+)@({NUMBER})=({NUMBER}),({NUMBER})", text)
    if not match:
        raise ArgumentTypeError(f"{text!r} is not of the form VIEW@Z=U,V, for example view1@-4.5=812,604")
    view, z_mm, u_px, v_px = match.groups()
    return (view, float(z_mm)), (float(u_px), float(v_px))


def stated_roll(text: str) -> tuple[str, float]:
    """View and angle of ``VIEW=DEG``."""
    match = re.fullmatch(rf"(.+)=({NUMBER})", text)
    if not match:
        raise ArgumentTypeError(f"{text!r} is not of the form VIEW=DEG, for example view1=180")
    return match[1], float(match[2])


def view_errors(calibration: Calibration) -> dict[str, Any]:
    """Residuals of a calibration by view, as the JSON of ``calibrate`` has them."""
    return {
        "views": {
            name: {
                "model": view.model.value,
                "n_points": view.n_points,
                "mean_error_px": view.mean_error_px,
                "rms_px": view.rms_px,
                "max_error_px": view.max_error_px,
                "holdout_error_px": view.holdout_error_px,
                "candidates_holdout_error_px": dict(view.candidates_px),
                "position_std_px": worst_position_std_px(view),
                "planes": [
                    {
                        "name": plane.name,
                        "z_mm": plane.z_mm,
                        "mean_error_px": plane.mean_error_px,
                        "rms_px": plane.rms_px,
                        "max_error_px": plane.max_error_px,
                        "holdout_error_px": plane.holdout_error_px,
                    }
                    for plane in view.planes
                ],
                "worst_plane": view.worst_plane.name,
                "placement": _placement(calibration, view),
                "verdict": view.verdict.value,
            }
            for name, view in calibration.views.items()
        }
    }


def _placement(calibration: Calibration, view: ViewCalibration) -> dict[str, Any] | None:
    """Where a view stands; None where boards in free poses do not tell."""
    if any(one.intrinsics_only for one in calibration.views.values()):
        return None
    ranges_mm = (calibration.x_range_mm, calibration.y_range_mm, calibration.z_range_mm)
    return asdict(placement(view.mapping, np.mean(ranges_mm, axis=1)))
