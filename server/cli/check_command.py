"""``tomoshadow check`` and ``tomoshadow self-calibrate``: what droplets say of a calibration."""

from argparse import Namespace
from typing import Any

from processing.calibration.calibration import Verdict
from processing.calibration.calibration_file import load_calibration, require_free, save_calibration
from processing.runs.run_check import ALARM_PX, STOP_PX, ShotCheck, check_shot, self_calibrate_run
from server.cli.commands import progress, selected_shots

_MEANING = {Verdict.WARN: "ALARM", Verdict.REFUSE: "STOP: do not reconstruct with this calibration"}


def check(options: Namespace) -> dict[str, Any]:
    """``tomoshadow check``; it has not passed where a shot would stop reconstruction."""
    calibration = load_calibration(options.calibration)
    shots = []
    for index in selected_shots(options.run, options.shots):
        measured = check_shot(options.run, index, calibration)
        progress(f"{options.run.name}: {check_line(measured)}")
        shots.append(measured)
    verdicts = [shot.verdict for shot in shots if shot.verdict is not None]
    return {
        "passed": Verdict.REFUSE not in verdicts,
        "run": options.run.name,
        "calibration": calibration.id,
        "alarm_px": ALARM_PX,
        "stop_px": STOP_PX,
        "verdict": max(verdicts, key=list(Verdict).index) if verdicts else None,
        "shots": [shot.record() for shot in shots],
    }


def check_line(measured: ShotCheck) -> str:
    """One shot for a person."""
    meaning = _MEANING.get(measured.verdict) if measured.verdict else None
    return f"shot {measured.shot}: {_finding(measured)}" + (f"  {meaning}" if meaning else "")


def _finding(measured: ShotCheck) -> str:
    """The figures and the view that has moved, or why there are no figures."""
    if not measured.views:
        return measured.problem
    views = ", ".join(
        f"{name} {view.disparity_px:.2f} ± {view.uncertainty_px:.2f} px" for name, view in measured.views.items()
    )
    return f"{views}, {measured.moved} has moved" if measured.moved else views


def self_calibrate_views(options: Namespace) -> dict[str, Any]:
    """``tomoshadow self-calibrate``."""
    require_free(options.out)
    calibration = load_calibration(options.calibration)
    shots = selected_shots(options.run, options.shots)
    progress(f"{options.run.name}: droplets of {len(shots)} shots")
    result = self_calibrate_run(options.run, shots, calibration)
    save_calibration(result.calibration, options.out)
    progress(result.calibration.notes[-1])
    return {
        "calibration": str(options.out),
        "id": result.calibration.id,
        "parent": calibration.id,
        "moved": result.moved,
        "sub_volumes": result.sub_volumes,
        "droplets": result.droplets,
        "uncertainty_px": result.uncertainty_px,
        "views": {
            name: {
                "correction_px": result.corrections_px[name],
                "disparity_before_px": result.before_px[name],
                "disparity_after_px": result.after_px[name],
                "verdict": result.calibration.views[name].verdict,
            }
            for name in result.calibration.views
        },
    }
