"""Let everything go wrong in runs, and time how it becomes dark: ``make soak PART=light TIMES=rounds``.

A fault is detected when a device has answered so, or a run does not wait any longer for an answer. Light off means: no
further pulse, and the generator has said itself that it is disarmed and dark. Faults of the stage are not tried: it
moves in the dark.
"""

import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from daq.faults import LABORATORY_FAULTS, LASTING_FAULTS, FaultKind
from daq.run.limits import AcquisitionLimits
from server.cli.output import endable, table
from tests.support.simulated_serving import BenchServing, eventually, serving_bench, tiny_config
from tests.support.watched_rig import Darkness, Witness

LIMITS = AcquisitionLimits(frame_s=0.3)
"""A camera that is silent for longer is a fault."""
LIMIT_S = 3.0
"""What has not led to darkness by then does not end a run."""
AMOUNTS: Mapping[FaultKind, float] = {
    FaultKind.PACKET_LOSS: 5,
    FaultKind.PACKETS_DOUBLED: 30,
    FaultKind.PACKETS_SWAPPED: 30,
    FaultKind.PULSE_B_LATE: 40_000,
    FaultKind.SERIAL_GARBAGE: 300,
}
KINDS = [kind for kind in FaultKind if kind not in (FaultKind.STAGE_STALL, FaultKind.STAGE_UNPLUGGED)]


@dataclass(frozen=True)
class Darkened:
    """What one fault led to.

    Parameters
    ----------
    kind : FaultKind
        What went wrong.
    darkness : Darkness | None
        How it became dark; None where it did not, as the run goes on.
    load : float
        Of the machine, over a minute.
    """

    kind: FaultKind
    darkness: Darkness | None
    load: float


def darken(bench: BenchServing, witness: Witness, kind: FaultKind) -> Darkened:
    """Let something go wrong in a run, and wait until it is dark; mend it."""
    bench.start(200)
    bench.await_shots(2)
    where: dict[str, Any] = {} if kind in LABORATORY_FAULTS else {"view": "view2"}
    witness.forget()
    bench.inject(kind.value, **where, amount=AMOUNTS.get(kind, 1))
    deadline_s = time.monotonic() + LIMIT_S
    while bench.acquisition.status().active and time.monotonic() < deadline_s and not _is_dark(witness):
        time.sleep(0.01)
    darkened = Darkened(kind, witness.darkness, round(os.getloadavg()[0], 1))
    if kind in LASTING_FAULTS:
        bench.inject(kind.value, **where, duration_s=0)
    bench.acquisition.stop()
    bench.end()
    eventually(lambda: _is_sound(bench), lambda: f"after {kind}: {bench.acquisition.status()}")
    return darkened


def _is_dark(witness: Witness) -> bool:
    darkness = witness.darkness
    return darkness is not None and darkness.confirmed_s is not None


def _is_sound(bench: BenchServing) -> bool:
    """Nothing is to be acknowledged, every device answers, and nothing speaks against the next run."""
    bench.http.post("/api/rig/acknowledge")
    lamps = bench.http.get("/api/rig").json()["lamps"]
    sound = all(lamp["health"] == "ok" for lamp in lamps if lamp["kind"] != "disk")
    return sound and not list(bench.acquisition.refusals())


def try_all(folder: Path, rounds: int, tell: Callable[[Darkened], None]) -> None:
    """Every kind of fault so many times."""
    witness = Witness()
    with serving_bench(tiny_config(folder / "runs", subnet=9), LIMITS, witness.watch) as bench:
        bench.laboratory.witnesses.append(witness.see_pulse)
        for _ in range(rounds):
            for kind in KINDS:
                tell(darken(bench, witness, kind))


def summary(found: Sequence[Darkened]) -> str:
    """A row per fault, and one of all; then those that end no run."""
    dark = {kind: [one.darkness for one in found if one.kind is kind and one.darkness] for kind in KINDS}
    rows = [_row(kind.value, some) for kind, some in dark.items() if some]
    rows.append(_row("all", [one for some in dark.values() for one in some]))
    heads = [
        "fault",
        "times",
        "last pulse ms, median",
        "p99",
        "worst",
        "confirmed off ms, median",
        "p99",
        "worst",
        "not",
    ]
    calm = ", ".join(kind.value for kind in KINDS if any(one.kind is kind and not one.darkness for one in found))
    loads = f"load {min(one.load for one in found):g} to {max(one.load for one in found):g}"
    machine = f"{os.cpu_count()} cores, {platform.machine()}, Linux {platform.release()}, {loads}"
    return f"{table(heads, rows)}\nthe run went on with the light: {calm or 'never'}\n{machine}"


def _row(name: str, some: Sequence[Darkness]) -> list[str]:
    confirmed_s = [one.confirmed_s for one in some if one.confirmed_s is not None]
    unconfirmed = str(len(some) - len(confirmed_s))
    return [name, str(len(some)), *_spread([one.last_pulse_s for one in some]), *_spread(confirmed_s), unconfirmed]


def _spread(times_s: Sequence[float]) -> tuple[str, ...]:
    """Median, 99th percentile, and the longest, in ms."""
    if not times_s:
        return ("-",) * 3
    spread_s = (statistics.median(times_s), float(np.percentile(times_s, 99)), max(times_s))
    return tuple(f"{1000 * time_s:.1f}" for time_s in spread_s)


def main() -> int:
    """Print the table; how often everything goes wrong is the first argument."""
    rounds = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    commit = subprocess.run(["git", "describe", "--always", "--dirty"], capture_output=True, text=True, check=False)
    found: list[Darkened] = []
    with tempfile.TemporaryDirectory() as folder, endable():
        try_all(Path(folder), rounds, found.append)
    sys.stdout.write(f"{summary(found)}\ncommit {commit.stdout.strip()}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
