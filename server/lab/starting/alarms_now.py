"""Alarms of the whole laboratory as they are now, and what it does to acknowledge one."""

from collections.abc import Iterator

from daq.causes import Cause, CauseCode, wrong
from daq.run.events import RunStatus
from daq.run.state import RunState
from server.lab.desk.alarms import Alarm, of_calibration, of_causes, of_lamps
from server.lab.services import Context, RunControl


def alarms_now(context: Context) -> Iterator[Alarm]:
    """Everything that is wrong: why the last run or live view ended, devices and work, the calibration."""
    status = context.services.acquisition.status()
    for cause in wrong(status.causes):
        yield from of_causes(_source(status), [cause], latched=_is_latched(cause, status))
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
    """Acknowledge its cause alone; a lamp is none, and its fault is cleared while a cause goes on waiting."""
    status = acquisition.status()
    causes = {(_source(status), cause.text): cause for cause in status.causes}
    cause = causes.get((alarm.source, alarm.text))
    if cause:
        acquisition.acknowledge(cause)
    else:
        acquisition.clear_faults()


def _is_latched(cause: Cause, status: RunStatus) -> bool:
    """It waits for an operator, or is the last thing that keeps the state FAULT."""
    if status.to_acknowledge:
        return cause in status.to_acknowledge
    return status.state is RunState.FAULT and cause.code is CauseCode.LIGHT_NOT_OFF


def _source(status: RunStatus) -> str:
    return f"run {status.ended_run}" if status.ended_run else "live view"
