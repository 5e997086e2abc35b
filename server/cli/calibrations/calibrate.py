"""``tomoshadow calibrate``: a camera for every view, and what its errors say."""

import re
from argparse import ArgumentTypeError, Namespace
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from processing.decimal_text import NUMBER
from server.cli.options import Verbs, add_out, add_verb, picture_beside
from server.cli.output import Outcome, progress, table, tracked

if TYPE_CHECKING:
    from processing.calibration.calibration import Calibration, ViewCalibration
    from processing.calibration.observation import CalibrationSet
    from processing.geometry import FloatArray


def add(verbs: Verbs) -> None:
    """Add the command."""
    parser = add_verb(verbs, "calibrate", calibrate_views, "fit the camera of every view to a calibration set")
    parser.add_argument("set", type=Path, help="calibration run, or the directory of an import which has a set")
    add_out(parser, "calibration file to write; pictures beside it")
    parser.add_argument(
        "--model",
        choices=("pinhole", "pinhole_tilted", "polynomial", "auto"),
        default="pinhole",
        help="auto: for each view the simplest one, unless another predicts unseen points clearly better",
    )
    parser.add_argument(
        "--origin",
        type=_stated_origin,
        action="append",
        metavar="VIEW@Z=U,V",
        help="where a view of a run sees the target's origin at position Z in mm, if no image shows all of it",
    )
    parser.add_argument(
        "--roll",
        type=_stated_roll,
        action="append",
        metavar="VIEW=DEG",
        help="how a camera of a run is turned about its axis: 180 if it hangs upside down",
    )

    parser.add_argument(
        "--mirrored",
        action="append",
        metavar="VIEW",
        help="a view of a run that looks by a mirror",
    )
    parser.add_argument(
        "--run",
        type=Path,
        help="a run of these views: the verdict then asks its droplets too; default: that of the same import",
    )


def _stated_origin(text: str) -> tuple[tuple[str, float], tuple[float, float]]:
    """View, position in mm and image point of ``VIEW@Z=U,V``."""
    match = re.fullmatch(rf"(.+)@({NUMBER})=({NUMBER}),({NUMBER})", text)
    if not match:
        raise ArgumentTypeError(f"{text!r} is not of the form VIEW@Z=U,V, for example view1@-4.5=812,604")
    view, z_mm, u_px, v_px = match.groups()
    return (view, float(z_mm)), (float(u_px), float(v_px))


def _stated_roll(text: str) -> tuple[str, float]:
    """View and angle of ``VIEW=DEG``."""
    match = re.fullmatch(rf"(.+)=({NUMBER})", text)
    if not match:
        raise ArgumentTypeError(f"{text!r} is not of the form VIEW=DEG, for example view1=180")
    return match[1], float(match[2])


def calibrate_views(options: Namespace) -> Outcome:
    """Fit, and write the calibration; it has not passed where a view is refused."""
    from processing.calibration.verdict import Verdict
    from processing.runs.overwriting import require_free
    from server.pictures.calibration_pictures import picture_paths

    figure = picture_beside(options.out)
    require_free(options.out, figure, *picture_paths(options.out), overwrite=options.overwrite)
    calibration_set, calibration = _fitted(options)
    figures = [str(picture) for picture in _written(options, calibration_set, calibration, figure)]
    _tell(calibration)
    result = {
        "passed": all(view.verdict is not Verdict.REFUSE for view in calibration.views.values()),
        "calibration": str(options.out),
        "id": calibration.id,
        "figure": str(figure),
        "figures": figures,
        "notes": list(calibration.notes),
        "not_checked": [asdict(unchecked) for unchecked in calibration.not_checked],
        **view_errors(calibration),
    }
    drawn_in = ", ".join([str(figure), *figures])
    return Outcome(result, f"{views_table(calibration)}\n{calibration.id}: {options.out}, pictures in {drawn_in}")


def _fitted(options: Namespace) -> "tuple[CalibrationSet, Calibration]":
    """The set, and the calibration of it, with what the droplets of its run say."""
    from processing.calibration.calibrate import calibrate
    from processing.calibration.sets.calibration_set import load_calibration_set
    from processing.runs.run_check import checked_by_run, run_beside

    calibration_set = load_calibration_set(
        options.set, dict(options.origin or ()), dict(options.roll or ()), options.mirrored or (), tracked
    )
    calibration = calibrate(calibration_set, model=options.model, counted=tracked)
    run_dir = options.run or run_beside(options.set)
    return calibration_set, calibration if run_dir is None else checked_by_run(calibration, run_dir)


def _written(
    options: Namespace, calibration_set: "CalibrationSet", calibration: "Calibration", figure: Path
) -> list[Path]:
    """Write the calibration, the figure of its residuals and pictures of its set; where these are."""
    from processing.calibration.calibration_file import save_calibration
    from processing.figures.residual_figures import residuals_figure
    from processing.runs.overwriting import replacing
    from server.pictures.calibration_pictures import calibration_pictures

    with replacing(options.out) as out:
        save_calibration(calibration, out)
        residuals_figure(calibration).savefig(out.with_name(figure.name), dpi=120)
        drawn = calibration_pictures(options.set, calibration_set, calibration, out)
    return [options.out.with_name(picture.name) for picture in drawn]


def _tell(calibration: "Calibration") -> None:
    """Notes, views that are refused, and what was not checked."""
    from processing.calibration.verdict import Verdict

    for note in calibration.notes:
        progress(note)
    for name, view in calibration.views.items():
        if view.verdict is Verdict.REFUSE:
            progress(f"{name}: REFUSED, {view.reasons[0]}: reconstruction does not start with it")
    for unchecked in calibration.not_checked:
        progress(f"not checked: {unchecked.what}; it would be by {unchecked.state}")


def views_table(calibration: "Calibration") -> str:
    """A line per view, for people."""
    middle_mm = _middle_mm(calibration)
    rows = [
        [
            name,
            view.verdict.value,
            f"{view.holdout_error_px:.4f}",
            str(view.n_points),
            str(view.n_rejected),
            *_scale_and_azimuth(view, middle_mm),
        ]
        for name, view in calibration.views.items()
    ]
    heads = ["view", "verdict", "hold-out [px]", "points", "left out", "px/mm", "azimuth [deg]"]
    reasons = [
        f"{name}: {view.verdict}: {'; '.join(view.reasons)}" for name, view in calibration.views.items() if view.reasons
    ]
    return "\n".join([table(heads, rows), *reasons])


def _scale_and_azimuth(view: "ViewCalibration", middle_mm: "FloatArray | None") -> tuple[str, str]:
    from processing.calibration.fit.placement import placement
    from processing.calibration.fit.scale_check import scale_px_per_mm

    if middle_mm is None:
        return "", ""
    return f"{scale_px_per_mm(view.mapping, middle_mm):.2f}", f"{placement(view.mapping, middle_mm).azimuth_deg:.2f}"


def view_errors(calibration: "Calibration") -> dict[str, Any]:
    """Residuals of a calibration by view, as the JSON of ``calibrate`` has them."""
    middle_mm = _middle_mm(calibration)
    return {"views": {name: _errors(view, middle_mm) for name, view in calibration.views.items()}}


_OF_A_PLANE = ("name", "z_mm", "mean_error_px", "rms_px", "max_error_px", "holdout_error_px")


def _errors(view: "ViewCalibration", middle_mm: "FloatArray | None") -> dict[str, Any]:
    from processing.calibration.fit.covariance import worst_position_std_px

    return {
        "model": view.model.value,
        "n_points": view.n_points,
        "n_rejected": view.n_rejected,
        "mean_error_px": view.mean_error_px,
        "rms_px": view.rms_px,
        "max_error_px": view.max_error_px,
        "holdout_error_px": view.holdout_error_px,
        "rays_miss_px": view.rays_miss_px,
        "candidates_holdout_error_px": dict(view.candidates_holdout_error_px),
        "position_std_px": worst_position_std_px(view),
        "planes": [{name: getattr(plane, name) for name in _OF_A_PLANE} for plane in view.planes],
        "worst_plane": view.worst_plane.name,
        "placement": _placement(view, middle_mm),
        "verdict": view.verdict.value,
        "reasons": list(view.reasons),
    }


def _placement(view: "ViewCalibration", middle_mm: "FloatArray | None") -> dict[str, Any] | None:
    from processing.calibration.fit.placement import placement

    return None if middle_mm is None else asdict(placement(view.mapping, middle_mm))


def _middle_mm(calibration: "Calibration") -> "FloatArray | None":
    """Middle of the target (3,); None where boards in free poses do not tell where views stand."""
    import numpy as np

    if any(view.intrinsics_only for view in calibration.views.values()):
        return None
    ranges_mm = (calibration.x_range_mm, calibration.y_range_mm, calibration.z_range_mm)
    return np.asarray(np.mean(ranges_mm, axis=1), dtype=np.float64)
