"""Open a rig and serve it: what ``tomoshadow serve`` does."""

import socket
from functools import partial

from daq.run.acquisition import Acquisition
from processing.calibration.calibration_file import file_sha256
from server.lab.calibrations import CalibrationStore
from server.lab.engine.engine_choice import engine_of
from server.lab.events import EventPublisher
from server.lab.services import Services
from server.lab.tasks import TASKS
from server.rig.assembly import AssembledRig, open_rig, recorded_configuration
from server.rig.config import RigConfig
from server.web.app import create_app, serve

_LAST_EVENTS_S = 3.0
"""A disk that does not keep up holds the end of a run back for longer; then its last event is in the log alone."""


def serve_rig(config: RigConfig, port_held: socket.socket, abort_port: socket.socket) -> None:
    """Serve a rig until SIGINT or SIGTERM; the light is off before and after.

    Parameters
    ----------
    config : RigConfig
        What to serve; its data directory is held by the caller.
    port_held, abort_port : socket
        Where to listen, for everything and for ABORT alone.

    Raises
    ------
    AlreadyHeld
        Another process has the rig; it goes on undisturbed.
    DeviceError
        A device is absent or does not answer.
    """
    with open_rig(config) as assembled:
        events = EventPublisher()
        with _acquisition(config, assembled, events) as acquisition:
            acquisition.recover()
            services = Services(
                config=config,
                rig=assembled.rig,
                acquisition=acquisition,
                events=events,
                engine=engine_of(config.processing, sorted({task.__module__ for task in TASKS.values()})),
                tasks=TASKS,
                laboratory=assembled.laboratory,
            )
            serve(create_app(services, abort_port), port_held, partial(leave, acquisition, events))


def leave(acquisition: Acquisition, events: EventPublisher, cause: str) -> None:
    """End what runs, and then the readers of events: they have seen how it ended, and hold up the server no longer."""
    acquisition.leave(cause)
    acquisition.wait(_LAST_EVENTS_S)
    events.detach()


def _acquisition(config: RigConfig, assembled: AssembledRig, events: EventPublisher) -> Acquisition:
    data_dir = config.server.data_dir
    calibrations = CalibrationStore(data_dir / "calibrations")
    return Acquisition(
        assembled.rig,
        data_dir,
        events.publish_run_event,
        configuration=recorded_configuration(config),
        hash_calibration=lambda name: file_sha256(calibrations.path(name)),
        limits=config.acquisition.to_limits(),
        observers=assembled.observers,
    )
