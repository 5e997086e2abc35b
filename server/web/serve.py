"""Open a rig and serve it: what ``tomoshadow serve`` does."""

from pathlib import Path

from daq.run.acquisition import Acquisition
from processing.calibration.calibration_file import file_sha256
from server.lab.calibrations import CalibrationStore
from server.lab.engine import DaskEngine
from server.lab.events import EventPublisher
from server.lab.services import Services
from server.lab.tasks import TASKS
from server.rig.assembly import AssembledRig, open_rig
from server.rig.config import RigConfig, load_config
from server.rig.rig_lock import hold_data_dir
from server.web.app import create_app, listening, serve


def serve_rig(config_file: Path, host: str | None = None, port: int | None = None) -> None:
    """Serve the rig of a configuration until SIGINT or SIGTERM; the light is off before and after.

    Raises
    ------
    ConfigError
        The configuration is wrong.
    AlreadyHeld
        Another process has the port, the data directory or the rig; it goes on undisturbed.
    DeviceError
        A device is absent or does not answer.
    """
    config = load_config(config_file)
    server = config.server.moved(host, port)
    config = config.model_copy(update={"server": server})
    with (
        listening(server.host, server.port) as port_held,
        hold_data_dir(server.data_dir),
        open_rig(config) as assembled,
    ):
        events = EventPublisher()
        with _acquisition(config, assembled, events) as acquisition:
            services = Services(
                config=config,
                rig=assembled.rig,
                acquisition=acquisition,
                events=events,
                engine=DaskEngine(),
                tasks=TASKS,
                laboratory=assembled.laboratory,
            )
            serve(create_app(services), port_held)


def _acquisition(config: RigConfig, assembled: AssembledRig, events: EventPublisher) -> Acquisition:
    data_dir = config.server.data_dir
    calibrations = CalibrationStore(data_dir / "calibrations")
    return Acquisition(
        assembled.rig,
        data_dir,
        events.publish_run_event,
        configuration=config.model_dump(mode="json"),
        hash_calibration=lambda name: file_sha256(calibrations.path(name)),
        limits=config.acquisition.to_limits(),
        observers=assembled.observers,
    )
