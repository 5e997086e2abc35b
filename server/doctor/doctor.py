"""What is wrong with computer and rig, and how to mend it."""

from collections.abc import Iterator
from pathlib import Path

from daq.counted import counted
from server.doctor.checkup import Checkup, Status
from server.doctor.doctor_host import check_host
from server.doctor.doctor_rig import check_rig
from server.doctor.doctor_scheduler import check_scheduler
from server.rig.config import ConfigError, load_config


def examine(config_file: Path | None) -> Iterator[Checkup]:
    """Look at the computer, and at the rig where a configuration is given; yields each finding as it is known."""
    if config_file is None:
        yield from check_host(Path())
        return
    try:
        config = load_config(config_file)
    except ConfigError as error:
        yield Checkup("configuration", Status.FAIL, str(error), "mend the line that the text names")
        yield from check_host(Path())
        return
    yield Checkup("configuration", Status.OK, f"{config_file}: {config.name}, {counted(len(config.views), 'view')}")
    yield from check_host(config.server.data_dir)
    if config.processing.scheduler:
        yield check_scheduler(config.processing)
    yield from check_rig(config)
