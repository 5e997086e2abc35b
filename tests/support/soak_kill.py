"""Kill the server at random moments while it records, start it again, and count what is lost: ``make soak PART=kill``.

The far ends of the rig run in a process of their own and stay alive; every image tells firing, view and exposure. What
the server has told as recorded is compared with the disk. Results are added to a file: a soak that was interrupted goes
on where it was, at the same commit.
"""

import json
import os
import platform
import random
import shutil
import statistics
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path

import httpx

from daq.errors import ShotFileError
from daq.files.run_directory import RunReader, Shot
from processing.synthetic.numbered import ImageNumber, number_of
from server.cli.output import endable, table
from server.rig.config import RigConfig, load_config
from tests.support.server_process import ENVIRONMENT, ServerProcess, eventually, stopped_at_end

ROOT = Path(__file__).parents[2]
SMALL = ROOT / "configs" / "simulated_small.toml"
SHOTS, RATE_HZ = 1000, 10.0
WAIT_S = (0.2, 4.0)
"""From the first shot of a run to the end of its server."""
RECORDED = "shot_recorded"


@dataclass(frozen=True)
class Killed:
    """One server that was killed while it recorded.

    Parameters
    ----------
    commit : str
        What was tried.
    acknowledged, on_disk : int
        Shots that the server had told as recorded, and shots in the directory of the run.
    lost : int
        Shots that were told, and are not on the disk or cannot be read.
    mispaired : int
        Exposures on the disk that belong to another firing, view or exposure than they stand for, or to none.
    first_shot_s : float | None
        From the start of this server to its first recorded shot, where another one was killed just before.
    outcome : str
        What the next server said of the run; empty where there was none.
    load : float
        Of the machine, over a minute.
    """

    commit: str
    acknowledged: int
    on_disk: int
    lost: int
    mispaired: int
    first_shot_s: float | None
    outcome: str
    load: float


def kill_servers(kills: int, work_dir: Path, commit: str, tell: Callable[[Killed], None]) -> None:
    """Kill so many servers, one after the other, and tell of each."""
    config = write_rig(work_dir)
    simulate = [sys.executable, "-m", "server.cli", "simulate", "--config", str(config)]
    with stopped_at_end(subprocess.Popen(simulate, cwd=work_dir, env=ENVIRONMENT)):
        before: _Recording | None = None
        for _ in range(kills):
            recording = _Recording(work_dir, config)
            try:
                if before is None:
                    recording.first_shot_s = None
                else:
                    tell(before.judged(commit, recording.outcome_of(before.run_id)))
                time.sleep(random.uniform(*WAIT_S))
            finally:
                recording.kill()
            before = recording
        if before is not None:
            tell(before.judged(commit, ""))


def write_rig(work_dir: Path) -> Path:
    """Rig file of four small cameras whose images tell what they are; its path."""
    text = SMALL.read_text().replace('"cameras/', f'"{SMALL.parent}/cameras/')
    for old, new in (("width_px = 400", "width_px = 320"), ("height_px = 300", "height_px = 240"), (".0.2.", ".0.6.")):
        text = text.replace(old, new)
    path = work_dir / "soak.toml"
    path.write_text(text.replace('firmware = "host"', 'firmware = "host"\nnumbered = true'))
    return path


class _Recording:
    """A server that records; ready once its first shot is on the disk."""

    def __init__(self, work_dir: Path, config: Path) -> None:
        started_s = time.monotonic()
        self._server = ServerProcess(work_dir, config)
        self._runs = work_dir / "runs"
        self._views = list(load_config(config).views)
        self.acknowledged: list[int] = []
        try:
            eventually(self._server.answers, "the server answers")
            self.run_id = self._start(load_config(config))
            self._listener = threading.Thread(target=self._listen, daemon=True)
            self._listener.start()
            eventually(lambda: bool(self.acknowledged), "a shot is recorded")
        except BaseException:
            self.kill()
            raise
        self.first_shot_s: float | None = time.monotonic() - started_s

    def kill(self) -> None:
        self._server.kill()

    def outcome_of(self, run_id: str) -> str:
        return str(self._server.http.get(f"/api/runs/{run_id}").json()["outcome"])

    def judged(self, commit: str, outcome: str) -> Killed:
        """Compare what was told with the disk, and remove the run."""
        self._listener.join()
        reader = RunReader(self._runs / self.run_id)
        on_disk = sorted(int(path.stem) for path in (reader.run_dir / "shots").glob("*.h5"))
        shots = {index: shot for index in on_disk if (shot := readable(reader, index)) is not None}
        lost = len(set(self.acknowledged) - shots.keys())
        mispaired = sum(mispaired_exposures(shot, self._views) for shot in shots.values())
        shutil.rmtree(reader.run_dir)
        load = os.getloadavg()[0]
        counts = (len(self.acknowledged), len(on_disk), lost, mispaired)
        return Killed(commit, *counts, self.first_shot_s, outcome, round(load, 1))

    def _start(self, config: RigConfig) -> str:
        """Start a run; the generator of a server that was killed has a fault, which somebody must acknowledge."""
        current_a = {name: view.nominal_current_a for name, view in config.views.items()}
        plan = {"name": "soak", "kind": "background", "shots": SHOTS, "rate_hz": RATE_HZ}
        answers: list[httpx.Response] = []

        def accepted() -> bool:
            self._server.http.post("/api/rig/acknowledge")
            answers.append(self._server.http.post("/api/runs", json=plan | {"pulse": {"current_a": current_a}}))
            return answers[-1].status_code == 201

        eventually(accepted, "a run is accepted", lambda: answers[-1].text)
        return answers[-1].headers["location"].rsplit("/", 1)[-1]

    def _listen(self) -> None:
        """Thread: until the server is killed."""
        with (
            suppress(httpx.TransportError),
            self._server.http.stream("GET", "/api/events", headers={"Last-Event-ID": "0"}) as stream,
        ):
            for line in stream.iter_lines():
                if line.startswith("data: "):
                    event = json.loads(line.removeprefix("data: "))
                    if event["name"] == RECORDED and event["data"]["run_id"] == self.run_id:
                        self.acknowledged.append(event["data"]["index"])


def readable(reader: RunReader, index: int) -> Shot | None:
    """A shot of a run; None if it cannot be read."""
    try:
        return reader.read_shot(index)
    except ShotFileError:
        return None


def mispaired_exposures(shot: Shot, views: Sequence[str]) -> int:
    """Exposures of a shot whose images say that they are something else; those that are flagged say nothing."""
    fired = shot.fired.sequence if shot.fired else -1
    wrong = 0
    for name, frames in shot.views.items():
        images = (("A", frames.frame_a, frames.record_a), ("B", frames.frame_b, frames.record_b))
        for frame, image, record in images:
            if image is not None and record is not None and record.valid:
                wrong += number_of(image) != ImageNumber(fired, views.index(name), frame)  # type: ignore[arg-type]
    return wrong


def summary(kills: Sequence[Killed]) -> str:
    """The table of all kills."""
    times_s = [kill.first_shot_s for kill in kills if kill.first_shot_s is not None]
    row = [
        str(len(kills)),
        *(str(sum(getattr(kill, name) for kill in kills)) for name in ("acknowledged", "lost", "mispaired")),
        str(sum(kill.outcome not in ("", "interrupted") for kill in kills)),
        *((f"{statistics.median(times_s):.1f}", f"{max(times_s):.1f}") if times_s else ("-", "-")),
        f"{min(kill.load for kill in kills):g} to {max(kill.load for kill in kills):g}",
    ]
    heads = ["kills", "shots told", "lost", "mispaired", "not closed", "first shot s, median", "max", "load"]
    machine = f"{os.cpu_count()} cores, {platform.machine()}, Linux {platform.release()}"
    return f"{table(heads, [row])}\ncommit {kills[0].commit}; {machine}"


def main() -> int:
    """Go on until there are so many kills of this commit."""
    wanted = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    work_dir = ROOT / "build" / "soak"
    work_dir.mkdir(parents=True, exist_ok=True)
    results = work_dir / "kill.jsonl"
    commit = subprocess.run(["git", "describe", "--always", "--dirty"], cwd=ROOT, capture_output=True, text=True)
    kills = [kill for kill in _read(results) if kill.commit == commit.stdout.strip()]

    def keep(kill: Killed) -> None:
        kills.append(kill)
        with results.open("a") as file:
            file.write(json.dumps(asdict(kill)) + "\n")
        sys.stderr.write(f"{len(kills)} of {wanted}: {kill}\n")

    with suppress(KeyboardInterrupt), endable():
        kill_servers(max(0, wanted - len(kills)), work_dir, commit.stdout.strip(), keep)
    sys.stdout.write(summary(kills) + "\n" if kills else "nothing was killed\n")
    return int(any(kill.lost or kill.mispaired for kill in kills))


def _read(results: Path) -> Iterator[Killed]:
    if results.exists():
        for line in results.read_text().splitlines():
            yield Killed(**json.loads(line))


if __name__ == "__main__":
    sys.exit(main())
