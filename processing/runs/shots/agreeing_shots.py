"""A calibration is corrected by shots that tell the same: what only some of them show is lost in the peaks of all."""

from collections.abc import Mapping, Sequence

from processing.analysis.near_or_far import depth_reversed
from processing.calibration.calibration import Calibration
from processing.calibration.droplets.self_calibration import SelfCalibration, self_calibrate
from processing.calibration.errors import CalibrationError
from processing.calibration.verdict import Verdict
from processing.count import counted
from processing.runs.shots.shot_check import (
    Exposure,
    ShotCheck,
    check_places,
    exposures_in_turn,
    require_droplets,
)
from processing.runs.shots.turned_views import meeting_sights

ASKED_AGAIN = 10
"""Shots, up to twice as many, that must agree with the correction, each by itself."""


def corrected_by(by_shot: Mapping[int, Sequence[Exposure]], calibration: Calibration, run: str) -> SelfCalibration:
    """Correct a calibration by the droplets (N, 2) of shots, exposures and views; the run is named where they refuse.

    Raises
    ------
    CalibrationError
        The droplets do not tell; depth is reversed; or shots speak against the correction that they are a part of.
    """
    exposures = [exposure for of_shot in by_shot.values() for exposure in of_shot]
    require_droplets(calibration, exposures)
    if problem := depth_reversed(meeting_sights(calibration, exposures_in_turn(by_shot))):
        raise CalibrationError(f"run {run}: {problem}. No view has moved: put images or calibration right")
    found = self_calibrate(calibration, exposures, run)
    _require_agreement(by_shot, found.calibration, run)
    return found


def _require_agreement(by_shot: Mapping[int, Sequence[Exposure]], corrected: Calibration, run: str) -> None:
    asked = list(by_shot)[:: max(1, len(by_shot) // ASKED_AGAIN)]
    checks = [check_places(shot, by_shot[shot], corrected) for shot in asked]
    if against := [check for check in checks if check.verdict in (Verdict.WARN, Verdict.REFUSE)]:
        raise CalibrationError(
            f"run {run}: {len(against)} of {counted(len(checks), 'shot')} that were asked by themselves speak against "
            f"what all tell together: {_told(against[0])}. Correct by shots before or after something changed "
            "(--shots); tomoshadow check says what each of them tells"
        )


def _told(check: ShotCheck) -> str:
    return f"shot {check.shot}: {check.problem or f'views are {check.worst_px:.2g} px beside each other'}"
