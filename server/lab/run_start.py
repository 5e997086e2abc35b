"""Starting a run: the one way for API and page."""

from daq.run_plan import RunKind, RunPlan
from server.lab.errors import Unprocessable
from server.lab.services import Context


def start_run(context: Context, plan: RunPlan) -> str:
    """Check what the server knows and start; the run id.

    A sample run without a calibration gets the current one, so that it travels with the run. Blocks until the run is
    accepted or refused.

    Raises
    ------
    Unprocessable
        The plan names a calibration that does not exist.
    DaqError
        Acquisition refuses, see ``daq.errors``.
    """
    if plan.calibration is not None and not context.calibrations.has(plan.calibration):
        raise Unprocessable(f"calibration: there is no calibration {plan.calibration!r}")
    if plan.calibration is None and plan.kind is RunKind.SAMPLE:
        plan = plan.model_copy(update={"calibration": context.calibrations.current})
    return context.services.acquisition.start(plan)


def choose_calibration(context: Context, calibration_id: str) -> None:
    """Make a calibration the current one, and tell every page; see ``CalibrationStore.choose``."""
    context.calibrations.choose(calibration_id)
    context.services.events.publish("calibration_chosen", calibration=calibration_id)
