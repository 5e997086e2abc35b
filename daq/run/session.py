"""RunSession: one run on devices and disk, worked by the acquisition thread: acquire, disarm, close."""

import threading
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import asdict
from datetime import UTC, datetime
from functools import partial
from itertools import chain
from pathlib import Path

from daq.errors import DeviceError, DeviceRefused, RecorderError, StorageError
from daq.files.header import RunClosing
from daq.files.outcome_note import write_note
from daq.files.run_directory import RunWriter
from daq.files.storage import storing
from daq.run import light
from daq.run.darkness import attempt, darken, fail
from daq.run.guard import RunGuard
from daq.run.recorder import Recorder
from daq.run.references import exchanged_cameras, mean_images
from daq.run.refusals import REMEDIES, RefusalCode
from daq.run.shooting import Shooting
from daq.run.shots.shot_check import InvalidStreak, ShotFindings, Thresholds, check_exposures, light_thresholds
from daq.run.shots.shot_taking import ShotTaker
from daq.run.shots.train_check import train_deviation
from daq.run.state import RunStep
from daq.run_plan import RunKind
from daq.shot import Shot

_RETRY_S = 1.0


class RunSession:
    """One run. Nothing here raises: an error switches the light off, then ends the run.

    Parameters
    ----------
    run : Shooting
        What to shoot, on which devices, and who is told.
    references : Mapping[RunKind, tuple[Path, ...]]
        Dark and background runs that belong to it.
    writer : RunWriter
        The open run.
    """

    def __init__(self, run: Shooting, references: Mapping[RunKind, tuple[Path, ...]], writer: RunWriter) -> None:
        self._run = run
        self._references = references
        self._rig = run.rig
        self._ending = run.ending
        self._writer = writer
        self._storage = ExitStack()
        self._taker: ShotTaker | None = None
        self._recorder: Recorder | None = None
        self._finishing = threading.Thread(target=self._try_to_finish, name="outcome", daemon=True)
        self._trouble = "the disk does not answer"
        self._closed = False
        self._ended_utc = ""

    def acquire(self) -> None:
        """Arm, and take all shots; returns when the last one is handed to the recorder, or the run is ended."""
        with RunGuard(self._run):
            self._attempt(self._acquire)
            if not self._ending.at_once:
                light.try_to_switch_off(self._rig)
        self._ending.end(RunStep.LAST_SHOT)

    def disarm(self) -> str | None:
        """Light off, then cameras; returns why the light could not be confirmed off."""
        return darken(self._run)

    def close(self) -> None:
        """Wait until every shot is on the disk, and the outcome too; a disk that hangs is left alone."""
        self._run.progress.wait_for("the disk: to take the last shots")
        self._attempt(self._storage.close)
        self._ended_utc = datetime.now(UTC).isoformat()
        if unstored := self._unstored():
            self._run.progress.say(f"fired and not stored: shots {', '.join(map(str, unstored))}")
        self._finishing.start()
        self._finishing.join(self._run.limits.drain_s)

    def insist(self, leaving: threading.Event) -> None:
        """Write an outcome that the disk did not take as soon as it does; when the program ends, leave a note of it."""
        if self._closed:
            return
        run_id, tell = self._writer.header.run_id, self._run.progress.tell
        tell(run_id, f"its outcome could not be written, that is tried until the disk takes it: {self._trouble}")
        while not self._closed and not leaving.wait(_RETRY_S):
            if not self._finishing.is_alive():
                self._try_to_finish()
        if self._closed:
            tell(run_id, f"its outcome is in its file now: {self._ending.outcome}")
        else:
            write_note(self._writer.run_dir, self._closing())

    def _acquire(self) -> None:
        plan = self._run.plan
        for observer in self._run.observers:
            observer.before_run(plan, self._writer.run_dir)
        self._write_devices()
        thresholds = self._copy_references()
        taker = self._taker = ShotTaker(self._run, thresholds)
        streak = InvalidStreak(self._run.limits.invalid_in_a_row, self._findings)
        recorder = self._recorder = self._start_recorder()
        self._arm(taker)
        for index in range(plan.total_shots):
            shot = taker.take(index)
            if shot is None:
                return
            self._run.progress.show(shot)
            recorder.put(shot)
            streak.count(shot)
        streak.require_a_valid_one()

    def _count(self, shot: Shot) -> None:
        self._run.progress.count(shot, "" if shot.valid else str(self._findings(shot)))

    def _findings(self, shot: Shot) -> ShotFindings:
        misfired = train_deviation(self._run.timing, shot.fired) if shot.fired else None
        return check_exposures(shot.views, misfired or "")

    def _arm(self, taker: ShotTaker) -> None:
        for camera in self._rig.cameras.values():
            if self._ending.step:
                return
            self._run.progress.wait_for(f"{camera.name}: to be armed")
            camera.arm()
        taker.load_position(0)
        if not self._ending.step:
            self._run.progress.move(RunStep.ARMED)

    def _write_devices(self) -> None:
        """Ask every device who it is, and name it in the run.

        One that is needed and does not answer ends it, and so does a camera that is not the one of the references.
        """
        devices, silent = {}, list[DeviceError]()
        for device in self._rig.devices:
            try:
                devices[device.name] = asdict(device.identity())
            except DeviceError as error:
                devices[device.name] = {"not answered": error.reason}
                if device is not self._rig.stage or self._run.plan.stage_z_mm:
                    silent.append(error)
        self._writer.write_devices(devices)
        if silent:
            raise silent[0]
        for view, difference in exchanged_cameras(chain(*self._references.values()), devices).items():
            raise DeviceRefused(view, f"{difference}: {REMEDIES[RefusalCode.REFERENCE_CAMERA]}")

    def _copy_references(self) -> Thresholds:
        """Let dark and background images travel with the run; returns the levels above which an exposure is lit."""
        dark, background = (mean_images(self._references[kind]) for kind in (RunKind.DARK, RunKind.BACKGROUND))
        if dark or background:
            self._writer.write_references(dark, background)
        bits = {view: view_format.bits for view, view_format in self._writer.header.views.items()}
        return light_thresholds(bits, dark, background)

    def _start_recorder(self) -> Recorder:
        """Start what ``close`` ends, in the opposite order."""
        limits, writer = self._run.limits, self._writer
        for observer in self._run.observers:
            self._storage.callback(self._attempt, partial(observer.after_run, writer.run_dir))
        depth, threads = limits.recorder_depth, limits.recorder_threads
        recorder = Recorder(writer, depth, threads, self._count, partial(fail, self._run))
        self._storage.enter_context(recorder)
        self._storage.callback(self._attempt, partial(recorder.close, limits.drain_s))
        return recorder

    def _try_to_finish(self) -> None:
        """Write the outcome; that the disk refuses it is no part of it, and nobody's light goes off for it."""
        try:
            self._writer.write_closing(self._closing())
        except (StorageError, OSError) as error:
            self._trouble = str(error)
            return
        except RecorderError:
            pass  # it has an outcome already: all that was refused was to sync its folder
        self._writer.close()
        self._closed = True

    def _closing(self) -> RunClosing:
        ending = self._ending
        return RunClosing(ending.outcome.value, ending.cause, self._ended_utc, ending.causes, self._unstored())

    def _unstored(self) -> tuple[int, ...]:
        """Shots that were fired and are not on the disk: those that waited for it, and the one under way."""
        if self._recorder is None or self._taker is None:
            return ()
        accepted, last = self._recorder.accepted, self._taker.last_fired
        under_way = () if last is None or last < accepted else (last,)
        return (*range(self._recorder.committed, accepted), *under_way)

    def _attempt(self, action: Callable[[], None]) -> None:
        """The top of the acquisition thread, with words for what a disk does."""

        def in_words() -> None:
            with storing(self._writer.run_dir):
                action()

        attempt(self._run, in_words)
