"""``tomoshadow doctor``: what is wrong with computer and rig, and how to mend it."""

from argparse import Namespace
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

from server.checkup import Checkup, Status
from server.commands import progress
from server.config import ConfigError, load_config
from server.doctor_host import check_host
from server.doctor_rig import check_rig


def doctor(options: Namespace) -> dict[str, Any]:
    """``tomoshadow doctor``; fails where a check does."""
    checks = []
    for check in _checks(options.config):
        progress(str(check))
        checks.append(check)
    return {
        "passed": all(check.status is not Status.FAIL for check in checks),
        "checks": [asdict(check) for check in checks],
    }


def _checks(config_file: Path | None) -> Iterator[Checkup]:
    if config_file is None:
        yield from check_host(Path())
        return
    try:
        config = load_config(config_file)
    except ConfigError as error:
        yield Checkup("configuration", Status.FAIL, str(error), "mend the line that the text names")
        yield from check_host(Path())
        return
    yield Checkup("configuration", Status.OK, f"{config_file}: {config.name}, {len(config.views)} views")
    yield from check_host(config.server.data_dir)
    yield from check_rig(config)
