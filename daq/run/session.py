"""RunSession: one run on devices and disk, worked by the acquisition thread: acquire, disarm, close."""

import threading
from collections.abc import Callable
from contextlib import ExitStack, suppress
from dataclasses import asdict
from datetime import UTC, datetime
from functools import partial

from daq.errors import DaqError, DeviceError
from daq.files.header import RunClosing
from daq.files.outcome_note import write_note
from daq.files.run_directory import RunWriter
from daq.run import light
from daq.run.active_run import ActiveRun
from daq.run.guard import RunGuard
from daq.run.recorder import Recorder
from daq.run.references import mean_images
from daq.run.shot_check import Thresholds, light_thresholds
from daq.run.shot_taking import ShotTaker
from daq.run.side_by_side import disarm_cameras
from daq.run.state import RunStep
from daq.run_plan import RunKind

_RETRY_S = 1.0


class RunSession:
    """One run. Nothing here raises: an error switches the light off, then ends the run.

    Parameters
    ----------
    run : ActiveRun
        What to do, on which devices, and who is told.
    writer : RunWriter
        The open run.
    """

    def __init__(self, run: ActiveRun, writer: RunWriter) -> None:
        self._run = run
        self._rig = run.rig
        self._ending = run.ending
        self._writer = writer
        self._storage = ExitStack()
        self._closed = False
        self._ended_utc = ""

    def acquire(self) -> None:
        """Arm, and take all shots; returns when the last one is handed to the recorder, or the run is ended."""
        with RunGuard(self._run):
            self._attempt(self._acquire)
            light.try_to_switch_off(self._rig)
        self._ending.end(RunStep.LAST_SHOT)

    def disarm(self) -> str | None:
        """Light off, then cameras; returns why the light could not be confirmed off."""
        limits = self._run.limits
        reason = light.confirm_off(self._rig, limits.light_off_s)
        if reason:
            self._ending.end(RunStep.ERROR, f"light not confirmed off: {reason}")
        for problem in disarm_cameras(self._rig.cameras, limits.disarm_s).values():
            self._run.progress.say(problem)
        return reason

    def close(self) -> None:
        """Wait until every shot is on the disk, then write the outcome."""
        self._attempt(self._storage.close)
        self._ended_utc = datetime.now(UTC).isoformat()
        self._attempt(self._finish)

    def insist(self, leaving: threading.Event) -> None:
        """Write an outcome that the disk did not take as soon as it does; when the program ends, leave a note of it."""
        run_id, tell = self._writer.header.run_id, self._run.progress.tell
        if not self._closed:
            tell(run_id, "its outcome could not be written: that is tried again until the disk takes it")
        while not self._closed and not leaving.wait(_RETRY_S):
            with suppress(DaqError, OSError):
                self._finish()
                tell(run_id, f"its outcome is in its file now: {self._ending.outcome}")
        if not self._closed:
            write_note(self._writer.run_dir, self._closing())

    def _acquire(self) -> None:
        plan = self._run.prepared.plan
        for observer in self._run.observers:
            observer.before_run(plan)
        self._write_devices()
        taker = ShotTaker(self._run, self._copy_references())
        recorder = self._start_recorder()
        self._arm(taker)
        for index in range(plan.total_shots):
            shot = taker.take(index)
            if shot is None:
                return
            recorder.put(shot)

    def _arm(self, taker: ShotTaker) -> None:
        for camera in self._rig.cameras.values():
            if self._ending.step:
                return
            camera.arm()
        taker.load_position(0)
        if not self._ending.step:
            self._run.progress.move(RunStep.ARMED)

    def _write_devices(self) -> None:
        """Ask every device who it is; one that does not answer ends the run, and those that do are named in it."""
        devices, silent = {}, list[DeviceError]()
        for device in self._rig.devices:
            try:
                devices[device.name] = asdict(device.identity())
            except DeviceError as error:
                devices[device.name] = {"not answered": error.reason}
                silent.append(error)
        self._writer.write_devices(devices)
        if silent:
            raise silent[0]

    def _copy_references(self) -> Thresholds:
        """Let dark and background images travel with the run; returns the levels above which an exposure is lit."""
        prepared = self._run.prepared
        dark, background = (mean_images(prepared.references[kind]) for kind in (RunKind.DARK, RunKind.BACKGROUND))
        if dark or background:
            self._writer.write_references(dark, background)
        bits = {view: view_format.bits for view, view_format in prepared.header.views.items()}
        return light_thresholds(bits, dark, background)

    def _start_recorder(self) -> Recorder:
        """Start what ``close`` ends, in the opposite order."""
        limits, writer = self._run.limits, self._writer
        for observer in self._run.observers:
            self._storage.callback(self._attempt, partial(observer.after_run, writer.run_dir))
        count, fail = self._run.progress.count, self._fail_by
        recorder = Recorder(writer, limits.recorder_depth, limits.recorder_threads, count, fail)
        self._storage.enter_context(recorder)
        self._storage.callback(self._attempt, partial(recorder.close, limits.drain_s))
        return recorder

    def _finish(self) -> None:
        self._writer.write_closing(self._closing())
        self._writer.close()
        self._closed = True

    def _closing(self) -> RunClosing:
        return RunClosing(self._ending.outcome.value, self._ending.cause, self._ended_utc)

    def _attempt(self, action: Callable[[], None]) -> None:
        """The top of the acquisition thread: whatever goes wrong, the light goes off before anything else."""
        try:
            action()
        except (DaqError, OSError) as error:
            self._fail(str(error))
        except Exception as error:  # noqa: BLE001  the top of a thread: a bug must not leave the light on
            self._fail(f"internal error: {error!r}")

    def _fail_by(self, error: Exception) -> None:
        self._fail(str(error))

    def _fail(self, cause: str) -> None:
        light.try_to_switch_off(self._rig)
        if not self._ending.end(RunStep.ERROR, cause) and cause != self._ending.cause:
            self._run.progress.say(cause)
