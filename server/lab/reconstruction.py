"""Reconstruction of recorded shots: which of them, by which calibration, and where results go."""

from collections.abc import Iterable, Sequence

from daq.counted import counted
from daq.run_plan import ImageKey
from processing.reconstruction.settings import ReconstructionSettings
from processing.runs.droplets.measure_settings import MeasureSettings
from server.lab.errors import Unprocessable
from server.lab.jobs.job import Job, reconstruction_job
from server.lab.results import result_calibration
from server.lab.services import Context


def request_reconstruction(
    context: Context,
    run_id: str,
    shots: Iterable[int] | None,
    calibration: str | None,
    settings: ReconstructionSettings,
) -> list[Job]:
    """Queue shots of a run; without ``shots`` all valid ones, without ``calibration`` the run's own or the current one.

    The last of them is checked first, and then the first: whether their droplets still agree with the calibration.

    Raises
    ------
    NotFound
        There is no such run or calibration.
    Unprocessable
        No calibration is known, or the run has no such shot.
    """
    chosen, wanted = requested_shots(context, run_id, shots, calibration)
    described, results_id = settings.model_dump(mode="json"), results_id_of(context, run_id, chosen, settings)
    jobs = [reconstruction_job(run_id, shot, chosen, results_id, described) for shot in wanted]
    return context.runner.submit_checked(jobs, run_id, chosen, ends_of(wanted))


def results_id_of(
    context: Context, run_id: str, calibration: str, settings: ReconstructionSettings | MeasureSettings
) -> str:
    """Where results of such settings go; those of a calibration that was replaced under its name stay by themselves."""
    by_name, content = settings.results_id(calibration), context.calibrations.content_id(calibration)
    made_with = result_calibration(context.runs.directory(run_id), by_name)
    return by_name if made_with in (None, content) else settings.results_id(f"{calibration} {content}")


def requested_shots(
    context: Context, run_id: str, shots: Iterable[int] | None, calibration: str | None
) -> tuple[str, list[int]]:
    """The calibration and the shots of a request.

    Raises
    ------
    NotFound
        There is no such run or calibration.
    Unprocessable
        No calibration is known, or the run has no such shot.
    """
    summary = context.runs.summary(run_id)
    chosen = calibration or summary.calibration or context.calibrations.current
    if chosen is None:
        raise Unprocessable(f"run {run_id} names no calibration, and none is current")
    context.calibrations.document(chosen)
    context.runs.require_sound(summary)
    wanted = _valid_shots(context, run_id) if shots is None else list(shots)
    if absent := [shot for shot in wanted if shot >= summary.shots_recorded]:
        raise Unprocessable(f"run {run_id} has {counted(summary.shots_recorded, 'shot')}, not {absent}")
    return chosen, wanted


def ends_of(shots: Sequence[int]) -> list[int]:
    """The shots of a request that are checked: the last, which comes first, and the first."""
    return list(dict.fromkeys((*shots[-1:], *shots[:1])))


def _valid_shots(context: Context, run_id: str) -> list[int]:
    keys = context.runs.image_keys(run_id)
    return [index for index, key in enumerate(keys.tolist()) if key == ImageKey.SAMPLE]
