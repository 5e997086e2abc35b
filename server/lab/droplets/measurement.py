"""Which shots are measured: those that an operator asks for."""

from collections.abc import Iterable

from processing.calibration.calibration_file import load_calibration
from processing.errors import BadInput
from processing.reconstruction.settings import GridSettings
from processing.runs.droplets.measure_settings import MeasureSettings, require_measurable
from processing.runs.measured_images import require_backgrounds
from processing.runs.stated_grid import parse_grid
from processing.runs.workbench import read_references
from server.lab.errors import Unprocessable
from server.lab.jobs.job import Job, JobKind, shot_job
from server.lab.reconstruction import ends_of, requested_shots, results_id_of
from server.lab.services import Context


def request_measurement(
    context: Context,
    run_id: str,
    shots: Iterable[int] | None,
    calibration: str | None,
    settings: MeasureSettings | None,
) -> list[Job]:
    """Queue the measurement of shots; what is not said is as of ``request_reconstruction``.

    Without ``settings`` a run is measured as it is recorded, with all defaults.

    Raises
    ------
    NotFound
        There is no such run or calibration.
    Unprocessable
        No calibration is known, the run has no such shot, or its images cannot be measured.
    """
    context.runs.require_sound(context.runs.summary(run_id))
    run = context.runs.reader(run_id)
    chosen_settings = settings or MeasureSettings(polarity=run.header.polarity)
    try:
        require_measurable(run_id, run.header.polarity, chosen_settings)
        if chosen_settings.polarity == "shadow":
            require_backgrounds(run, read_references(run))
    except BadInput as error:
        raise Unprocessable(str(error)) from error
    return queue_measurement(context, run_id, shots, calibration, chosen_settings)


def settings_within(context: Context, run_id: str, box: str) -> MeasureSettings | None:
    """Settings of a run for a box that is stated as with ``--grid``; None, all defaults, where none is.

    Raises
    ------
    NotFound
        There is no such run or calibration.
    Unprocessable
        The box is not of that form, or no calibration is known.
    """
    if not box.strip():
        return None
    chosen, _ = requested_shots(context, run_id, (), None)
    try:
        grid = parse_grid(box.strip(), load_calibration(context.calibrations.path(chosen)), "Box")
    except BadInput as error:
        raise Unprocessable(str(error)) from error
    return MeasureSettings(polarity=context.runs.reader(run_id).header.polarity, grid=GridSettings.of(grid))


def queue_measurement(
    context: Context, run_id: str, shots: Iterable[int] | None, calibration: str | None, settings: MeasureSettings
) -> list[Job]:
    """The same of a run whose images can be measured: that was asked before, or is found out by the job."""
    chosen, wanted = requested_shots(context, run_id, shots, calibration)
    results_id = results_id_of(context, run_id, chosen, settings)
    described = settings.model_dump(mode="json")
    jobs = [shot_job(JobKind.MEASUREMENT, run_id, shot, chosen, results_id, described) for shot in wanted]
    return context.runner.submit_checked(jobs, run_id, chosen, ends_of(wanted))
