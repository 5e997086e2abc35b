"""RunSession: one run on devices and disk, worked by the acquisition thread: acquire, disarm, close."""

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import asdict
from datetime import UTC, datetime
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from daq.devices import Rig
from daq.errors import DaqError
from daq.files.run_directory import RunHeader, RunWriter
from daq.run import light
from daq.run.disarming import disarm_cameras
from daq.run.ending import RunControl
from daq.run.guard import RunGuard
from daq.run.limits import AcquisitionLimits
from daq.run.preflight import PreparedRun
from daq.run.recorder import Recorder
from daq.run.references import mean_images
from daq.run.shot_check import Thresholds, light_thresholds
from daq.run.shot_taking import ShotTaker
from daq.run.state import OUTCOMES, RunStep
from daq.run_plan import RunKind
from daq.shot import Shot

_SOFTWARE = ("tomoshadow", "numpy", "h5py", "isal", "pydantic")


def describe_run(
    rig: Rig, run: PreparedRun, configuration: Mapping[str, Any], calibration_sha256: str | None
) -> RunHeader:
    """Header of a run: what was asked for, of which devices, by which software."""
    devices = [rig.generator, rig.interlock, *rig.cameras.values(), *([rig.stage] if rig.stage else [])]
    return RunHeader(
        run_id=run.run_id,
        created_utc=datetime.now(UTC).isoformat(),
        views=dict(run.views),
        plan=run.plan,
        configuration=dict(configuration),
        devices={device.name: asdict(device.identity()) for device in devices},
        software=_software_versions(),
        calibration_id=run.plan.calibration,
        calibration_sha256=calibration_sha256,
        separation_ns=run.plan.pulse.separation_ns,
    )


class RunSession:
    """One run. Nothing here raises: an error switches the light off, then ends the run through ``control``.

    Parameters
    ----------
    rig : Rig
        Open devices.
    run : PreparedRun
        What to do.
    control : RunControl
        Ends the run early, and says how it ended.
    limits : AcquisitionLimits
        Deadlines.
    say : Callable[[str], None]
        Gets a line for everything that is worth one.
    """

    def __init__(
        self, rig: Rig, run: PreparedRun, control: RunControl, limits: AcquisitionLimits, say: Callable[[str], None]
    ) -> None:
        self._rig = rig
        self._run = run
        self._control = control
        self._limits = limits
        self._say = say
        self._storage = ExitStack()

    def acquire(
        self,
        run_dir: Path,
        describe: Callable[[], RunHeader],
        on_armed: Callable[[], None],
        on_commit: Callable[[Shot], None],
    ) -> None:
        """Arm, and take all shots; returns when the last one is handed to the recorder, or the run is ended."""
        with RunGuard(self._rig, self._control, self._limits.heartbeat_s):
            self._attempt(partial(self._acquire, run_dir, describe, on_armed, on_commit))
            light.try_to_switch_off(self._rig)
        self._control.end(RunStep.LAST_SHOT)

    def disarm(self) -> str | None:
        """Light off, then cameras; returns why the light could not be confirmed off."""
        reason = light.confirm_off(self._rig, self._limits.light_off_s)
        if reason:
            self._control.end(RunStep.ERROR, f"light not confirmed off: {reason}")
        for problem in disarm_cameras(self._rig.cameras, self._limits.disarm_s).values():
            self._say(problem)
        return reason

    def close(self) -> None:
        """Wait until every shot is on the disk, then write the outcome."""
        self._attempt(self._storage.close)

    def _acquire(
        self,
        run_dir: Path,
        describe: Callable[[], RunHeader],
        on_armed: Callable[[], None],
        on_commit: Callable[[Shot], None],
    ) -> None:
        self._rig.prepare_scene(self._run.plan.kind)
        recorder, thresholds = self._open(run_dir, describe(), on_commit)
        taker = ShotTaker(self._rig, self._run, self._control, self._limits, thresholds, self._say)
        for camera in self._rig.cameras.values():
            if self._control.ending:
                return
            camera.arm()
        taker.load_position(0)
        if not self._control.ending:
            on_armed()
        for index in range(self._run.plan.total_shots):
            shot = taker.take(index)
            if shot is None:
                return
            recorder.put(shot)

    def _open(self, run_dir: Path, header: RunHeader, on_commit: Callable[[Shot], None]) -> tuple[Recorder, Thresholds]:
        """Open the run directory; what is opened here is closed in the opposite order by ``close``."""
        writer = self._storage.enter_context(RunWriter(run_dir, header))
        self._storage.callback(self._finish, writer)
        dark, background = (mean_images(self._run.references[kind]) for kind in (RunKind.DARK, RunKind.BACKGROUND))
        if dark or background:
            writer.write_references(dark, background)
        self._storage.callback(self._attempt, partial(self._rig.keep_truth, run_dir))
        recorder = Recorder(writer, self._limits.recorder_depth, self._limits.recorder_threads, on_commit)
        self._storage.enter_context(recorder)
        self._storage.callback(self._attempt, partial(recorder.close, self._limits.drain_s))
        bits = {view: view_format.bits for view, view_format in self._run.views.items()}
        return recorder, light_thresholds(bits, dark, background)

    def _finish(self, writer: RunWriter) -> None:
        ending = self._control.ending or RunStep.ERROR
        writer.finish(OUTCOMES[ending].value, self._control.cause)

    def _attempt(self, action: Callable[[], None]) -> None:
        """The top of the acquisition thread: whatever goes wrong, the light goes off before anything else."""
        try:
            action()
        except (DaqError, OSError) as error:
            self._fail(str(error))
        except Exception as error:  # noqa: BLE001  the top of a thread: a bug must not leave the light on
            self._fail(f"internal error: {error!r}")

    def _fail(self, cause: str) -> None:
        light.try_to_switch_off(self._rig)
        if not self._control.end(RunStep.ERROR, cause):
            self._say(cause)


def _software_versions() -> dict[str, str]:
    versions = {}
    for package in _SOFTWARE:
        try:
            versions[package] = version(package)
        except PackageNotFoundError:
            versions[package] = "not installed as a package"
    return versions
