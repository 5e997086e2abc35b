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
from server.rig.config import ConfigError, RigConfig

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
def hold_far_ends(config: RigConfig) -> Iterator[None]:
    """Hold the far ends of a simulated rig, whoever works with its drivers; AlreadyHeld names their process."""
    with _hold(config.name, (f"far end of {address}" for address in _cameras(config))):
        yield


def far_end_address(config: RigConfig) -> str:
    """Where the far ends of a simulated rig answer: a local socket of the network that its cameras are in.

    Its name is abstract: it vanishes with its process, however that ends.
    """
    return "\0" + _far_end_name(config, "laboratory")


def far_end_port(config: RigConfig, device: str) -> Path:
    """Where a serial port of the far ends is, in whatever process they run."""
    return _folder() / _far_end_name(config, device)


def _far_end_name(config: RigConfig, what: str) -> str:
    first = min(view.camera.ip for view in config.views.values())
    return f"tomoshadow-{what}-of-{first}-of-network-{_NETWORK.stat().st_ino}"


@contextmanager
def hold_data_dir(data_dir: Path) -> Iterator[None]:
    """Hold a folder of runs, made if need be; AlreadyHeld names its holder, ConfigError says why it cannot be made."""
    try:
        data_dir.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise ConfigError(f"data directory {data_dir}: cannot be made ({reason}): name another folder") from error
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
