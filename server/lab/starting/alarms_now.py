"""Alarms of the whole laboratory as they are now, and what it does to acknowledge one."""

from collections.abc import Iterator

from daq.run.events import RunStatus
from daq.run.state import RunOutcome, RunState
from server.lab.desk.alarms import Alarm, of_calibration, of_causes, of_lamps
from server.lab.services import Context, RunControl


def alarms_now(context: Context) -> Iterator[Alarm]:
    """Everything that is wrong: the last run, devices and work, the calibration. Reads the last run if it failed."""
    status = context.services.acquisition.status()
    waiting = status.to_acknowledge
    yield from of_causes(_source(status), waiting, latched=True)
    if status.outcome is RunOutcome.FAILED and status.run_id is not None and status.resting:
        known = {cause.text for cause in waiting}
        others = [cause for cause in context.runs.summary(status.run_id).causes if cause.text not in known]
        yield from of_causes(_source(status), others, latched=status.state is RunState.FAULT and not waiting)
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
        _clear(context.services.acquisition, alarm)
    context.desk.acknowledge(alarm_id)


def _clear(acquisition: RunControl, alarm: Alarm) -> None:
    """Of several causes that wait for an operator this one alone; a lamp is none of them."""
    status = acquisition.status()
    waiting = {(_source(status), cause.text): cause for cause in status.to_acknowledge}
    cause = waiting.get((alarm.source, alarm.text))
    if cause or not waiting:
        acquisition.acknowledge(cause)
    else:
        acquisition.clear_faults()


def _source(status: RunStatus) -> str:
    return f"run {status.run_id}" if status.run_id else "live view"
