"""Starting a run, or a single shot: the one way for API and page."""

from typing import Annotated

from pydantic import Field

from daq.frozen_model import FrozenModel
from daq.names import Identifier
from daq.run_plan import PulsePair, RunKind, RunPlan
from server.lab.errors import Unprocessable
from server.lab.services import Context


def start_run(context: Context, plan: RunPlan) -> str:
    """Check what the server knows and start; the run id.

    A sample run without a calibration gets the current one, so that it travels with the run. Blocks until the run is
    accepted or refused.

    Raises
    ------
    Unprocessable
        The plan names a calibration that does not exist, or one of images of another size.
    DaqError
        Acquisition refuses, see ``daq.errors``.
    """
    if plan.calibration is not None and not context.calibrations.has(plan.calibration):
        raise Unprocessable(f"calibration: there is no calibration {plan.calibration!r}")
    if plan.calibration is None and plan.kind is RunKind.SAMPLE:
        plan = plan.model_copy(update={"calibration": context.calibrations.current})
    if plan.calibration is not None:
        _check_image_sizes(context, plan.calibration)
    return context.services.acquisition.start(plan)


class SingleShot(FrozenModel):
    """One shot that is kept on request only."""

    pulse: Annotated[PulsePair, Field(description="its light")]
    references: Annotated[
        tuple[str, ...], Field(description="run ids of the dark and background runs that belong to it")
    ] = ()
    calibration: Annotated[Identifier | None, Field(description="for its volumes; null: the current one")] = None


def shoot(context: Context, shot: SingleShot) -> str:
    """Start a run of one shot, which the next one removes; the run id. Raises what ``start_run`` raises."""
    plan = RunPlan(
        name="single-shot", shots=1, pulse=shot.pulse, references=shot.references, calibration=shot.calibration
    )
    return context.unkept_runs.add(lambda: start_run(context, plan))


def _check_image_sizes(context: Context, calibration: str) -> None:
    """A camera that is binned, or another one, needs another calibration; later nothing could be reconstructed."""
    sizes_px = context.calibrations.image_sizes_px(calibration)
    for view, camera in context.services.rig.cameras.items():
        rows, columns = camera.image_shape
        made_for = sizes_px.get(view, (columns, rows))
        if made_for != (columns, rows):
            raise Unprocessable(
                f"calibration: {calibration!r} is made for images of {made_for[0]} x {made_for[1]} px of {view}, its "
                f"camera delivers {columns} x {rows} px: choose another calibration, or calibrate again"
            )


def choose_calibration(context: Context, calibration_id: str) -> None:
    """Make a calibration the current one, and tell every page; see ``CalibrationStore.choose``."""
    context.calibrations.choose(calibration_id)
    context.services.events.publish("calibration_chosen", calibration=calibration_id)
