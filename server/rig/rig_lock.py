"""Who holds a rig: every address of it is locked before any device of it is opened.

A second client would take over the cameras of the first one and end its run. Addresses are locked one by one, because
two configurations may name the same device. Those of the network belong to a network namespace, as the cameras of a
simulated rig do.
"""

import os
import re
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from daq.files.lock_file import hold
from server.rig.config import RigConfig

_SHARED_BY_ALL_USERS = Path("/run/lock")
_NETWORK = Path("/proc/self/ns/net")


@contextmanager
def hold_rig(config: RigConfig) -> Iterator[None]:
    """Hold all devices of a rig until the block ends; AlreadyHeld names the device and its holder."""
    with _hold(config.name, (*_ports(config), *_cameras(config))):
        yield


@contextmanager
def hold_generator(config: RigConfig) -> Iterator[None]:
    """Hold the pulse generator of a rig alone; AlreadyHeld names its holder."""
    with _hold(config.name, list(_ports(config))[:1]):
        yield


@contextmanager
def hold_data_dir(data_dir: Path) -> Iterator[None]:
    """Hold a folder of runs, made if need be; AlreadyHeld names its holder."""
    data_dir.mkdir(parents=True, exist_ok=True)
    with hold(data_dir / ".lock", f"data directory {data_dir}"):
        yield


@contextmanager
def _hold(rig: str, addresses: Iterable[str]) -> Iterator[None]:
    with ExitStack() as held:
        for address in addresses:
            name = re.sub(r"[^A-Za-z0-9.]+", "-", address).strip("-")
            held.enter_context(hold(_folder() / f"tomoshadow-{name}.lock", f"rig {rig!r}: {address}"))
        yield


def _ports(config: RigConfig) -> Iterator[str]:
    """Serial ports, the generator's first; a simulated rig makes its own."""
    if config.simulation is None:
        for device in (config.pulse_generator, config.stage):
            if device is not None:
                yield f"port {os.path.realpath(device.port)}"


def _cameras(config: RigConfig) -> Iterator[str]:
    network = _NETWORK.stat().st_ino
    for view in config.views.values():
        yield f"camera {view.camera.ip} of network {network}"


def _folder() -> Path:
    return _SHARED_BY_ALL_USERS if os.access(_SHARED_BY_ALL_USERS, os.W_OK) else Path(tempfile.gettempdir())
