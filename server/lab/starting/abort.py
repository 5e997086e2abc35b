"""Abort: the one way to end whatever makes light, for every door of the server."""

from daq.errors import DaqError
from daq.run.events import RunStatus
from server.lab.services import Services


def abort_all(services: Services) -> str:
    """Switch the light off now, from any thread, and end what runs; says what that was, to everybody.

    Raises
    ------
    DaqError
        The generator did not confirm that the light is off; acquisition goes on trying.
    """
    what = _under_way(services.acquisition.status())
    try:
        services.acquisition.abort()
    except DaqError as error:
        services.events.publish("abort", text=f"ABORT of {what}: light not confirmed off: {error}")
        raise
    services.events.publish("abort", text=f"ABORT of {what}: light confirmed off")
    return what


def _under_way(status: RunStatus) -> str:
    if status.live is not None:
        return "the live view"
    return f"run {status.run_id}" if status.active else "nothing: no run was under way"
