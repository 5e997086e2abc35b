"""Does a calibration still fit the shots of a run? Asked of the droplets in them."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np

from daq.files.run_directory import ImageKey, RunReader
from daq.files.run_file import RUN_FILE
from processing.calibration.calibration import Calibration
from processing.calibration.calibration_record import content_id
from processing.calibration.droplets.droplet_images import find_droplets
from processing.calibration.droplets.self_calibration import SelfCalibration
from processing.calibration.errors import CalibrationError
from processing.calibration.fit.not_checked import DROPLETS
from processing.calibration.sets.calibration_set import SET_FILE
from processing.calibration.verdict import Doubt, Verdict, doubt_of_shot
from processing.progress import Counted, in_silence
from processing.reconstruction.settings import ReconstructionSettings
from processing.runs.errors import PipelineError
from processing.runs.exposure_faults import odd_lights
from processing.runs.manifest.importing import CALIBRATION_FOLDER, RUN_FOLDER
from processing.runs.results_file import FrameName
from processing.runs.seen_views import seen_views
from processing.runs.shots.agreeing_shots import corrected_by
from processing.runs.shots.shot_check import Exposure, ShotCheck, check_shots
from processing.runs.shots.shot_images import shot_intensities
from processing.runs.shots.stated_lengths import untold_doubt
from processing.runs.workbench import Workbench

CHECKED_SHOTS = 3
"""Shots of a run that a calibration is checked by; the watch over a run checks more of them."""
_FRAMES: tuple[FrameName, ...] = ("a", "b")


def check_shot(run_dir: Path, shot: int, calibration: Calibration, workbench: Workbench | None = None) -> ShotCheck:
    """Measure the disparity of every view in one recorded shot; a workbench has the references of the run ready.

    Raises
    ------
    CalibrationError
        The calibration does not belong to the views of the run.
    PipelineError
        An exposure is missing.
    """
    (check,) = _checked(run_dir, [shot], calibration, workbench)
    return check


def check_few(
    run_dir: Path, shots: Sequence[int], calibration: Calibration, workbench: Workbench | None = None
) -> list[ShotCheck]:
    """Check the first, the middle and the last of some shots: what was wrong all along, or has gone wrong meanwhile.

    Views of the calibration that the run lacks are left out.

    Raises
    ------
    CalibrationError
        The calibration is refused, or does not belong to the views of the run.
    PipelineError
        An exposure is missing.
    """
    few = list(dict.fromkeys((shots[0], shots[len(shots) // 2], shots[-1])))
    return _checked(run_dir, few, _seen_in(run_dir, calibration), workbench)


def check_each(
    run_dir: Path, shots: Sequence[int], calibration: Calibration, workbench: Workbench | None = None
) -> list[ShotCheck]:
    """Check all of some shots, each by itself: what is wrong need not be the same in any two of them.

    Views of the calibration that the run lacks are left out.

    Raises
    ------
    CalibrationError
        The calibration is refused, or does not belong to the views of the run.
    PipelineError
        An exposure is missing.
    """
    seen, workbench = _seen_in(run_dir, calibration), workbench or Workbench()
    return [check_shot(run_dir, shot, seen, workbench) for shot in shots]


def _seen_in(run_dir: Path, calibration: Calibration) -> Calibration:
    """The views that a run has."""
    with RunReader(run_dir) as run:
        calibration.require_usable(run.header.views)
        return replace(calibration, views={name: calibration.views[name] for name in run.header.views})


def odd_images(run_dir: Path, shot: int, workbench: Workbench) -> tuple[str, ...]:
    """What speaks against the images of a shot, whatever its droplets say of a calibration.

    Raises
    ------
    PipelineError
        An exposure is missing.
    """
    with workbench.occupied() as bench, RunReader(run_dir) as run:
        recorded, references = run.read_shot(shot), bench.references(run)
        frames = _FRAMES[: run.header.frames_per_shot]
        odd = {frame: odd_lights(seen_views(run, recorded, frame, references), run.header.polarity) for frame in frames}
    return tuple(f"exposure {frame}: {view} {what}" for frame, said in odd.items() for view, what in said.items())


def run_beside(calibration_set: Path) -> Path | None:
    """The run of the import that a calibration set, or its folder, is a part of; None where there is none."""
    folder = calibration_set if (calibration_set / SET_FILE).exists() else calibration_set / CALIBRATION_FOLDER
    run_dir = folder.parent / RUN_FOLDER
    return run_dir if (folder / SET_FILE).exists() and (run_dir / RUN_FILE).exists() else None


def checked_by_run(calibration: Calibration, run_dir: Path) -> Calibration:
    """The calibration with verdicts that the droplets of the first shots of a run agree with.

    A run that does not tell, as it has few droplets or other views, is noted.
    """
    try:
        checks = check_shots(_droplets(run_dir, _first_shots(run_dir), calibration), calibration)
    except CalibrationError as error:
        return _noted(calibration, run_dir, str(error))
    doubts = [_doubt(run_dir.name, check, check.verdict) for check in checks if check.verdict]
    if not doubts:
        return _noted(calibration, run_dir, checks[0].problem if checks else "it has no shot with all exposures")
    known = replace(calibration, not_checked=tuple(one for one in calibration.not_checked if one != DROPLETS))
    worst = max(doubts, key=lambda doubt: list(Verdict).index(doubt.verdict))
    checked = known.doubted([worst] if worst.verdict in (Verdict.WARN, Verdict.REFUSE) else [])
    return checked.with_id(content_id(checked))


def _first_shots(run_dir: Path) -> list[int]:
    """The first shots with all exposures; references are none."""
    with RunReader(run_dir) as run:
        samples = np.flatnonzero(run.image_keys() == ImageKey.SAMPLE)
        valid = (int(index) for index in samples if run.read_shot(int(index)).valid)
        return list(islice(valid, CHECKED_SHOTS))


def _noted(calibration: Calibration, run_dir: Path, problem: str) -> Calibration:
    noted = replace(calibration, notes=(*calibration.notes, f"run {run_dir.name} does not tell: {problem}"))
    return noted.with_id(content_id(noted))


def _doubt(run: str, check: ShotCheck, verdict: Verdict) -> Doubt:
    """What the droplets of a shot say of the views that it names, or of all."""
    views = (check.moved,) if check.moved else check.beyond or tuple(check.views)
    problem = check.problem or f"droplets are seen {check.worst_px:.2g} px beside where the other views put them"
    return doubt_of_shot(views, check.shot, run, problem, verdict)


def self_calibrate_run(
    run_dir: Path, shots: Sequence[int], calibration: Calibration, counted: Counted = in_silence
) -> SelfCalibration:
    """Correct a calibration by the droplets in recorded shots, exposures A and B alike.

    ``counted`` is told of the shots, one by one.

    Raises
    ------
    CalibrationError
        The droplets do not tell, or not the same in all shots, or depth is reversed; or the calibration does not
        belong to the views of the run.
    PipelineError
        An exposure is missing.
    """
    return corrected_by(_droplets(run_dir, shots, calibration, counted), calibration, run_dir.name)


def _checked(
    run_dir: Path, shots: Sequence[int], calibration: Calibration, workbench: Workbench | None
) -> list[ShotCheck]:
    """What droplets say of the views, and the rig of the run of all lengths."""
    checks = check_shots(_droplets(run_dir, shots, calibration, workbench=workbench), calibration)
    with RunReader(run_dir) as run:
        untold = untold_doubt(run.header, calibration)
    return [replace(check, untold=untold) for check in checks]


def _droplets(
    run_dir: Path,
    shots: Sequence[int],
    calibration: Calibration,
    counted: Counted = in_silence,
    workbench: Workbench | None = None,
) -> dict[int, list[Exposure]]:
    """Droplets by shot, exposure and view, in the order of the views of the calibration."""
    calibration.require_world()
    settings = ReconstructionSettings()
    with (workbench or Workbench()).occupied() as bench, RunReader(run_dir) as run:
        _check_views(run, calibration)
        found: dict[int, list[Exposure]] = {}
        references = bench.references(run)
        for index in counted(shots, lambda index: f"droplets of shot {index}"):
            shot = run.read_shot(index)
            if not shot.valid:
                raise PipelineError(f"{run_dir.name}, shot {index}: exposures are missing, nothing to check")
            exposures = []
            for frame in _FRAMES[: run.header.frames_per_shot]:
                seen = shot_intensities(run, shot, frame, settings, references=references)
                images = dict(zip(shot.views, seen, strict=True))
                exposures.append([find_droplets(images[name]) for name in calibration.views])
            found[index] = exposures
    return found


def _check_views(run: RunReader, calibration: Calibration) -> None:
    formats = run.header.views
    if set(formats) != set(calibration.views):
        raise CalibrationError(
            f"run {run.header.run_id} has views {sorted(formats)}, "
            f"calibration {calibration.id} has {sorted(calibration.views)}"
        )
    for name, view in calibration.views.items():
        (rows, columns), (width, height) = formats[name].shape, view.mapping.image_size_px
        if (columns, rows) != (width, height):
            raise CalibrationError(
                f"run {run.header.run_id}, {name}: image of {columns} x {rows} px, calibrated for {width} x {height} px"
            )
