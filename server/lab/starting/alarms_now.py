"""Alarms of the whole laboratory as they are now, and what it does to acknowledge one."""

from collections.abc import Iterator

from daq.run.state import RunOutcome, RunState
from server.lab.desk.alarms import Alarm, of_calibration, of_lamps, of_run
from server.lab.services import Context


def alarms_now(context: Context) -> Iterator[Alarm]:
    """Everything that is wrong: the last run, devices and work, the calibration. Reads the last run if it failed."""
    status = context.services.acquisition.status()
    if status.outcome is RunOutcome.FAILED and status.run_id is not None and status.resting:
        yield from of_run(context.runs.summary(status.run_id), latched=status.state is RunState.FAULT)
    yield from of_lamps(context.lamps)
    yield from of_calibration(context.standing)


def acknowledge(context: Context, alarm_id: str) -> None:
    """An operator has seen an alarm; a latched fault is cleared, or stays with the reason why it cannot be.

    Raises
    ------
    NotFound
        It is gone.
    DaqError
        The fault cannot be cleared yet.
    """
    alarm = next((one for one in context.desk.alarms if one.id == alarm_id), None)
    if alarm is not None and alarm.latched:
        context.services.acquisition.acknowledge()
    context.desk.acknowledge(alarm_id)
