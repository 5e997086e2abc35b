"""``tomoshadow check``: what the droplets in the shots of a run say of a calibration."""

from argparse import Namespace
from statistics import median
from typing import TYPE_CHECKING, Any

from daq.counted import counted
from server.cli.chosen_shots import selected_shots
from server.cli.options import Verbs, add_calibrated_run, add_shots, add_verb
from server.cli.output import Outcome, progress, table, tracked

if TYPE_CHECKING:
    from collections.abc import Sequence

    from processing.calibration.calibration import Calibration
    from processing.calibration.verdict import Verdict
    from processing.runs.shots.shot_check import ShotCheck

_MEANING = {"warn": "ALARM", "refuse": "STOP: do not reconstruct with this calibration"}


def add(verbs: Verbs) -> None:
    """Add the command."""
    summary = "do the droplets in the shots of a run still agree with a calibration?"
    parser = add_verb(verbs, "check", check, summary)
    add_calibrated_run(parser)
    add_shots(parser)


def check(options: Namespace) -> Outcome:
    """Check shot by shot; it has not passed where a shot would stop reconstruction."""
    from daq.files.run_directory import RunReader
    from processing.analysis.near_or_far import added, doubts_of
    from processing.calibration.calibration_file import load_calibration
    from processing.calibration.verdict import Verdict
    from processing.runs.shots.shot_check import ALARM_PX, STOP_PX
    from processing.runs.unchecked_images import told_unchecked, unknown_height

    calibration = load_calibration(options.calibration)
    shots, odd = _shot_by_shot(options, calibration)
    with RunReader(options.run) as run:
        unchecked = told_unchecked([unknown_height(run.header)], progress)
    for doubt in (depth := doubts_of(added(shot.sights for shot in shots))):
        progress(f"{options.run.name}: {doubt}")
    verdict = _verdict(shots, odd, depth)
    result = {
        "passed": verdict is not Verdict.REFUSE,
        "run": options.run.name,
        "calibration": calibration.id,
        "alarm_px": ALARM_PX,
        "stop_px": STOP_PX,
        "verdict": verdict,
        "shots": [{**shot.record(), "odd_light": list(what)} for shot, what in zip(shots, odd, strict=True)],
        "depth": list(depth),
        "not_checked": unchecked,
    }
    return Outcome(result, views_table(result))


def _shot_by_shot(options: Namespace, calibration: "Calibration") -> "tuple[list[ShotCheck], list[tuple[str, ...]]]":
    """What droplets say of each shot, and what is odd with its images; both are told as they come."""
    from processing.runs.run_check import check_shot, odd_images
    from processing.runs.workbench import Workbench

    workbench, shots, odd = Workbench(), [], []
    for index in tracked(selected_shots(options.run, options.shots)):
        shots.append(check_shot(options.run, index, calibration, workbench))
        progress(f"{options.run.name}: {check_line(shots[-1])}")
        odd.append(odd_images(options.run, index, workbench))
        for what in odd[-1]:
            progress(f"{options.run.name}: shot {index}, {what}")
    return shots, odd


def _verdict(shots: "Sequence[ShotCheck]", odd: "Sequence[Sequence[str]]", depth: "Sequence[str]") -> "Verdict | None":
    """The worst of all shots, of images of alternating rows, and of a depth that counts the other way."""
    from processing.calibration.verdict import Verdict
    from processing.interlaced import ALTERNATING

    woven = any(what.endswith(ALTERNATING) for told in odd for what in told)
    verdicts = [shot.verdict for shot in shots if shot.verdict is not None]
    verdicts += [Verdict.WARN] * woven + [Verdict.REFUSE] * bool(depth)
    return max(verdicts, key=list(Verdict).index, default=None)


def check_line(measured: "ShotCheck") -> str:
    """One shot for a person."""
    meaning = _MEANING.get(measured.verdict) if measured.verdict else None
    told = "; ".join(filter(None, (_finding(measured), measured.untold)))
    return f"shot {measured.shot}: {told}" + (f"  {meaning}" if meaning else "")


def _finding(measured: "ShotCheck") -> str:
    """The figures and the view that has moved, or why there are no figures."""
    if not measured.views:
        return measured.problem
    views = ", ".join(
        f"{name} {view.disparity_px:.2f} ± {view.uncertainty_px:.2f} px" for name, view in measured.views.items()
    )
    return f"{views}, {measured.moved} has moved" if measured.moved else views


def views_table(result: dict[str, Any]) -> str:
    """A line per view over all shots that tell, and the verdict, for people."""
    told = [shot for shot in result["shots"] if shot["views"]]
    verdict = f"{len(told)} of {counted(len(result['shots']), 'shot')} tell: {result['verdict'] or 'no verdict'}"
    limits = f"alarm above {result['alarm_px']:g} px, stop above {result['stop_px']:g} px"
    if not told:
        return f"{verdict}; {limits}"
    disparities_px = {name: [shot["views"][name] for shot in told] for name in told[0]["views"]}
    rows = [[name, f"{median(values):.2f}", f"{max(values):.2f}"] for name, values in disparities_px.items()]
    return f"{table(['view', 'median [px]', 'largest [px]'], rows)}\n{verdict}; {limits}"
