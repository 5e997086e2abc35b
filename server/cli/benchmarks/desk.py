"""What people who look cost a server: browsers with the tiles of a live view, whose cameras are simulated elsewhere."""

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from statistics import median, quantiles
from tempfile import TemporaryDirectory
from typing import Any

from websockets.sync.client import connect

from daq.counted import counted
from daq.run.state import RunState
from processing.benchmarks import targets
from processing.benchmarks.targets import Measured
from server.cli.benchmarks import busy_server
from server.cli.benchmarks.bench_rig import NoRig, rig_in
from server.cli.benchmarks.browsed import TIMES, browsed
from server.cli.benchmarks.served import Server, calibrated, served, start
from server.lab.jobs.job import JobState
from server.pictures.previews import AXES
from server.rig.config import load_config

BROWSERS, RATE_HZ, LOOKED_S = 3, 10.0, 20.0
RECORDED_HZ, _ASK_S = 1.0, 0.02
VOLUMES_OF_HZ, _TURN_S = 4.0, 0.1
"""The page waits so long after each volume."""
_WARM_S, _DEADLINE_S = 3.0, 30.0


@dataclass(frozen=True)
class _Spent:
    """CPU time of a server per second, and the pictures that a reader got of each view."""

    cores: float
    pictures_hz: float


def desk(directory: Path | None, time_s: float) -> Iterator[Measured]:
    """All lines of the desk, by one server; its cameras are simulated in another process."""
    with TemporaryDirectory(dir=directory) as folder:
        config = rig_in(Path(folder), still=True)
        currents_a = {name: view.nominal_current_a for name, view in load_config(config).views.items()}
        live = {"rate_hz": RATE_HZ, "pulse": {"current_a": currents_a}}
        with _far_ends(config), served(config, busy_server.__spec__.name) as server:
            yield from browsed(server, live, TIMES)
            yield _looked_at(server, live, time_s)
            calibration = calibrated(server, config, Path(folder) / "runs")
            yield _live_volume(server, calibration, live, time_s)
            yield _asked(server, config, calibration, time_s)


def _looked_at(server: Server, live: dict[str, Any], time_s: float) -> Measured:
    """CPU time of a server whose live view is looked at, less that of the same live view in the dark."""
    views = len(live["pulse"]["current_a"])
    server.ask("rig/live", live, "PUT")
    alone = _spent(server, 0, views, time_s)
    looked = _spent(server, BROWSERS, views, time_s)
    server.ask("rig/live", method="DELETE")
    if not looked.pictures_hz:
        raise NoRig(f"not one picture came within {time_s:g} s: this machine is too busy")
    added_cores = (looked.cores - alone.cores) * RATE_HZ / looked.pictures_hz
    how = (
        f"from {looked.pictures_hz:.1f} pictures/s of each view; then the server with its cameras takes "
        f"{100 * looked.cores:.0f} %, {100 * alone.cores:.0f} % with nobody there"
    )
    return Measured(targets.LOOKED_AT, 100 * added_cores, how=how)


def _live_volume(server: Server, calibration: str, live: dict[str, Any], time_s: float) -> Measured:
    """New volumes that a page shows of a live view of so many shots per second."""
    server.ask("calibrations/current", {"id": calibration}, "PUT")
    server.ask("rig/live", {**live, "rate_hz": VOLUMES_OF_HZ}, "PUT")
    took_s, last, end_s = [], 0, time.perf_counter() + _WARM_S + time_s
    with ThreadPoolExecutor(len(AXES)) as pool:
        while (now_s := time.perf_counter()) < end_s:
            view = server.ask("rig/live/volume")
            if view["number"] != last:
                last = view["number"]
                middle = {axis: count // 2 for axis, count in zip(AXES, view["shape"], strict=True)}
                list(
                    pool.map(lambda axis, at=middle: server.get(f"rig/live/volume/slices/{axis}/{at[axis]}.png"), AXES)
                )
                took_s += [view["took_s"]] if now_s > end_s - time_s else []
            time.sleep(_TURN_S)
    server.ask("rig/live", method="DELETE")
    how = f"live view at {VOLUMES_OF_HZ:g} Hz; a volume is seen by all views after {median(took_s):.2g} s"
    return Measured(targets.LIVE_VOLUME, len(took_s) / time_s, how=how)


def _asked(server: Server, config: Path, calibration: str, time_s: float) -> Measured:
    """How long a script waits for the state of the rig, while a run is recorded and its shots are reconstructed."""
    start(server, config, round(time_s * RECORDED_HZ), calibration, RECORDED_HZ)
    waits_ms = []
    while server.ask("rig")["acquisition"]["state"] != RunState.IDLE:
        began_s = time.perf_counter()
        server.ask("rig")
        waits_ms.append(1000 * (time.perf_counter() - began_s))
        time.sleep(_ASK_S)
    done = sum(job["state"] == JobState.DONE for job in server.ask("jobs"))
    work = f"shots at {RECORDED_HZ:g} Hz, {counted(done, 'volume')} made"
    how = f"{len(waits_ms)} times, median {median(waits_ms):.2g} ms; {work}"
    return Measured(targets.ASKED, quantiles(waits_ms, n=20)[-1], how=how)


def _spent(server: Server, readers: int, views: int, time_s: float) -> _Spent:
    with ThreadPoolExecutor(max(1, readers)) as pool:
        counts = [pool.submit(_count_pictures, server.live_address, _WARM_S, time_s) for _ in range(readers)]
        time.sleep(_WARM_S)
        began_s, cpu_s = time.perf_counter(), _cpu_s(server.process.pid)
        time.sleep(time_s)
        cores = (_cpu_s(server.process.pid) - cpu_s) / (time.perf_counter() - began_s)
        pictures = sum(count.result(_DEADLINE_S) for count in counts)
    return _Spent(cores, pictures / max(1, readers) / views / time_s)


def _count_pictures(address: str, warm_s: float, time_s: float) -> int:
    """Pictures that one reader gets in a time, as fast as they come."""
    count, begin_s = 0, time.perf_counter() + warm_s
    with connect(address) as reader:
        while (now_s := time.perf_counter()) < begin_s + time_s:
            message = reader.recv(_DEADLINE_S, decode=False)
            json.loads(message[3 : 3 + int.from_bytes(message[1:3], "big")])
            count += now_s >= begin_s
    return count


def _cpu_s(process: int) -> float:
    """CPU time of a process so far, all threads: fields 14 and 15 of proc(5)."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


@contextmanager
def _far_ends(config: Path) -> Iterator[None]:
    """The devices of the rig in a process of their own, so that their work is not the server's."""
    command = [sys.executable, "-m", "server.cli", "simulate", "--config", str(config)]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
        try:
            if not any("its far ends run" in line for line in process.stderr or ()):
                raise NoRig(f"tomoshadow simulate ended with {process.wait(_DEADLINE_S)}")
            yield
        finally:
            process.terminate()
            process.wait(_DEADLINE_S)
