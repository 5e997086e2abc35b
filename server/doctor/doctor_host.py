"""What ``tomoshadow doctor`` asks of the computer: system, packages, Aravis, kernels, network buffers, disk."""

import os
import platform
import re
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, requires, version
from pathlib import Path

from daq.drivers.aravis_camera import ARAVIS_REMEDY, load_aravis
from daq.errors import DeviceUnavailable
from processing.kernels import _native
from server.doctor.checkup import Checkup, Status

RMEM_MAX_BYTES = 4 * 2**20
"""Receive buffer of a camera's stream: two exposures of 1600 x 1200 px."""
DISK_MB_PER_S = 100.0
"""Four views at five double exposures per second write 77 MB/s."""
FREE_DISK_BYTES = 20e9
_MEMORY_BYTES = 4e9
_TRIAL_BYTES = 64 * 2**20
_RMEM_MAX = Path("/proc/sys/net/core/rmem_max")
_DEADLINE_S = 10.0


def check_host(data_dir: Path) -> Iterator[Checkup]:
    """Look at the computer; yields each finding as it is known.

    Parameters
    ----------
    data_dir : Path
        Where runs are kept; it need not exist yet.
    """
    yield _check_system()
    yield check_packages()
    yield _check_aravis()
    yield _check_kernels()
    yield _check_namespaces()
    yield check_receive_buffer()
    yield check_disk(data_dir)


def _check_system() -> Checkup:
    """Processor, memory and operating system."""
    memory_bytes = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    detail = (
        f"{platform.freedesktop_os_release()['PRETTY_NAME']}, {platform.machine()}, {os.cpu_count()} cores, "
        f"{memory_bytes / 1e9:.1f} GB of memory, Python {platform.python_version()}"
    )
    if memory_bytes < _MEMORY_BYTES:
        remedy = "reconstruct smaller regions (--grid), or use a larger computer"
        return Checkup("host", Status.WARN, f"{detail}; below {_MEMORY_BYTES / 1e9:g} GB", remedy)
    return Checkup("host", Status.OK, detail)


def check_packages(distribution: str = "tomoshadow") -> Checkup:
    """Packages that a distribution needs."""
    names = [re.split(r"[^A-Za-z0-9._-]", need)[0] for need in requires(distribution) or () if "extra ==" not in need]
    missing = [name for name in names if not _is_installed(name)]
    if missing:
        return Checkup("python packages", Status.FAIL, f"missing: {', '.join(missing)}", "make setup")
    return Checkup("python packages", Status.OK, f"{len(names)} of {len(names)}, tomoshadow {version('tomoshadow')}")


def _is_installed(name: str) -> bool:
    try:
        version(name)
    except PackageNotFoundError:
        return False
    return True


def _check_aravis() -> Checkup:
    """Aravis, which opens cameras; a computer that has none does without."""
    try:
        load_aravis("doctor")
    except DeviceUnavailable:
        return Checkup("aravis", Status.WARN, "cannot be loaded: no camera can be opened from here", ARAVIS_REMEDY)
    return Checkup("aravis", Status.OK, "cameras can be opened")


def _check_kernels() -> Checkup:
    """Instruction sets that the kernels use."""
    available, selected = _native.available_isas(), _native.selected_isa()
    detail = f"{selected} of {', '.join(available)}"
    if len(available) == 1:
        return Checkup("kernels", Status.WARN, detail, "none on this processor: without AVX2 everything is slower")
    return Checkup("kernels", Status.OK, detail)


def _check_namespaces() -> Checkup:
    """Permission to have a network of one's own: demonstration and tests run in one."""
    command = ["unshare", "--user", "--net", "--map-root-user", "true"]
    try:
        result = subprocess.run(command, capture_output=True, text=True, timeout=_DEADLINE_S, check=False)
        reason = result.stderr.strip() if result.returncode else ""
    except (OSError, subprocess.TimeoutExpired) as error:
        reason = str(error)
    if reason:
        remedy = "sysctl kernel.unprivileged_userns_clone=1; without it the demonstration runs in the open network"
        return Checkup("user namespaces", Status.WARN, reason, remedy)
    return Checkup("user namespaces", Status.OK, "permitted")


def check_receive_buffer(file: Path = _RMEM_MAX) -> Checkup:
    """Room for the packets of a shot in a socket."""
    name = "receive buffer"
    try:
        found_bytes = int(file.read_text())
    except OSError as error:
        return Checkup(name, Status.WARN, f"{file}: {error.strerror}", "look at it outside a container")
    detail = f"net.core.rmem_max is {found_bytes} bytes"
    if found_bytes < RMEM_MAX_BYTES:
        remedy = f"sysctl -w net.core.rmem_max={RMEM_MAX_BYTES}, and the same line in /etc/sysctl.d/"
        return Checkup(name, Status.WARN, f"{detail}, below {RMEM_MAX_BYTES}: packets may be lost", remedy)
    return Checkup(name, Status.OK, detail)


def check_disk(data_dir: Path) -> Checkup:
    """Room for runs, and the rate at which a recorder writes that waits for each shot to be durable."""
    folder = next(path for path in (data_dir.absolute(), *data_dir.absolute().parents) if path.is_dir())
    try:
        rate_mb_s = _write_rate_mb_s(folder)
    except OSError as error:
        remedy = "make it writable, or choose another server.data_dir"
        return Checkup("disk", Status.FAIL, f"{folder}: {error.strerror}", remedy)
    free_bytes = shutil.disk_usage(folder).free
    detail = f"{folder}: {free_bytes / 1e9:.0f} GB free, {rate_mb_s:.0f} MB/s durably written"
    if free_bytes < FREE_DISK_BYTES:
        remedy = "move old runs elsewhere"
        return Checkup("disk", Status.WARN, f"{detail}; below {FREE_DISK_BYTES / 1e9:g} GB", remedy)
    if rate_mb_s < DISK_MB_PER_S:
        remedy = "use a faster disk for server.data_dir, or record at a lower rate"
        return Checkup("disk", Status.WARN, f"{detail}; below {DISK_MB_PER_S:g} MB/s", remedy)
    return Checkup("disk", Status.OK, detail)


def _write_rate_mb_s(folder: Path) -> float:
    block = os.urandom(2**20)
    with tempfile.NamedTemporaryFile(dir=folder, prefix=".doctor-") as file:
        started_s = time.perf_counter()
        for _ in range(_TRIAL_BYTES // len(block)):
            file.write(block)
        file.flush()
        os.fsync(file.fileno())
        return _TRIAL_BYTES / 1e6 / (time.perf_counter() - started_s)
