"""Acquisition: one run or one live view at a time, on a thread of its own."""

import logging
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from itertools import chain
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from daq.causes import Cause, CauseCode
from daq.devices import Rig
from daq.errors import BusyError, DaqError, PlanError, StorageError
from daq.files.recovery import recover
from daq.files.run_directory import RunWriter
from daq.files.storage import folder_number
from daq.run import light
from daq.run.ending import RunEnding, why_it_ends
from daq.run.events import RunEvent, RunMessage, RunStatus
from daq.run.limits import AcquisitionLimits
from daq.run.live.live_session import LiveSession
from daq.run.live.live_start import Audience, checked_plan
from daq.run.preflight import Preflight, PreparedRun
from daq.run.progress import RunProgress
from daq.run.refusals import RefusalCode, coded, impossible, not_acknowledged, raise_first, starts_already
from daq.run.session import RunSession
from daq.run.shooting import RunObserver, Shooting
from daq.run.state import RunState, RunStep, next_state
from daq.run_plan import LivePlan, RunPlan
from daq.shot import Shot
from daq.timing import ShotTiming

_ARMING_S = 10.0
"""What a live view may be busy with when it is asked to end: cameras that are being armed, one of them silent."""

_LOG = logging.getLogger(__name__)


def _nobody_listens(_: RunEvent) -> None:
    """Events are for who wants them."""


def _no_calibration_store(_: str) -> None:
    """Without a store of calibrations a run names its calibration, but not its hash."""


class Acquisition:
    """Runs plans on a rig, and shows it live. The rig is open; the light is off unless a run or a live view is active.

    Every method may be called from any thread; none but ``start``, ``start_live`` and ``wait`` takes longer than a
    command to the pulse generator.

    Parameters
    ----------
    rig : Rig
        Open devices.
    data_dir : Path
        Where run directories are made.
    publish : Callable[[RunEvent], None]
        Gets every event, from several threads; must not block.
    configuration : Mapping[str, Any]
        The resolved configuration of the rig (JSON), stored in every run.
    hash_calibration : Callable[[str], str | None]
        SHA-256 of a calibration by its id, stored in every run that names one.
    limits : AcquisitionLimits
        Deadlines.
    observers : sequence of RunObserver
        Who takes part in every run without being a device.
    """

    def __init__(
        self,
        rig: Rig,
        data_dir: Path,
        publish: Callable[[RunEvent], None] = _nobody_listens,
        configuration: Mapping[str, Any] | None = None,
        hash_calibration: Callable[[str], str | None] = _no_calibration_store,
        limits: AcquisitionLimits | None = None,
        observers: Sequence[RunObserver] = (),
    ) -> None:
        self._rig = rig
        self._data_dir = data_dir
        self._publish = publish
        self._configuration = dict(configuration or {})
        self._hash_calibration = hash_calibration
        self._limits = limits or AcquisitionLimits()
        self._observers = tuple(observers)
        self._starting = threading.Lock()
        self._left = ""
        self._leaving = threading.Event()
        self._threads: list[threading.Thread] = []
        self._progress = RunProgress(publish)
        self._ending = RunEnding()
        self._live_ending = RunEnding()
        self._audience = Audience()
        self._folder: tuple[int, int] | None = None

    def __enter__(self) -> Self:
        self._data_dir.mkdir(parents=True, exist_ok=True)
        self._folder = folder_number(self._data_dir)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.leave(why_it_ends(error))
        self.wait(self._limits.light_off_s + self._limits.disarm_s + self._limits.drain_s)
        self._leaving.set()
        for thread in self._threads:
            thread.join(self._limits.light_off_s)

    def status(self) -> RunStatus:
        """Snapshot; never waits for a device."""
        return self._progress.status()

    @property
    def newest_shot(self) -> Shot | None:
        """What the rig saw last, in a run or a live view; None before the first shot."""
        return self._progress.newest_shot

    def recover(self) -> None:
        """Close runs whose process is gone as INTERRUPTED, and tell; the caller holds the data directory."""
        for found in recover(self._data_dir):
            _LOG.warning("run %s: %s", found.run_id, found.text)
            self._publish(RunMessage(found.run_id, found.text))

    def refusals(self, plan: RunPlan | None = None) -> Iterator[DaqError]:
        """Why a run, or this one, does not start now, in the order in which ``start`` looks; none if it does.

        While a run is under way no device is asked: the light may be on.
        """
        if self._starting.locked():
            yield starts_already()
        yield from self._refusals_of_state(RunStep.START)
        if not self.status().active:
            yield from self._preflight().refusals_of_rig()
        if plan is not None:
            yield from self._preflight().refusals_of_plan(plan)

    def start(self, plan: RunPlan) -> str:
        """Check the plan and start the run; returns its id. A live view ends first, its light confirmed off.

        Raises
        ------
        BusyError
            A run is active or just starting, a fault waits to be acknowledged, or the program is ending.
        NotAcknowledged
            What ended last had several causes, and not all of them are acknowledged.
        PlanError
            The plan cannot run on this rig, or the disk does not hold it; the text names value and limit.
        InterlockOpen
            The light must not be switched on.
        DeviceError
            The generator has a latched fault or does not answer.
        """
        with self._starting_alone(RunStep.START):
            ending = self._ending = RunEnding()
            prepared, writer = self._prepare(plan)
            self._progress.begin(prepared.header.run_id, plan)
            session = RunSession(self._shooting(plan, prepared.timing, ending), prepared.references, writer)
            work = partial(self._work, session, ending)
            self._start_thread(threading.Thread(target=work, name="acquisition", daemon=True))
        return prepared.header.run_id

    def start_live(self, plan: LivePlan) -> None:
        """Check the plan and show the rig live. A live view of another plan ends first.

        Raises what ``start`` raises.
        """
        with self._starting_alone(RunStep.LIVE):
            ending = self._ending = RunEnding()
            shots, timing = checked_plan(self._rig, plan)
            self._end_live_before(RunStep.LIVE, "another live view starts")
            self._live_ending = ending
            self._audience.look()
            session = LiveSession(self._shooting(shots, timing, ending), self._audience)
            self._progress.begin_live(plan)
            self._start_thread(threading.Thread(target=session.work, name="live", daemon=True))

    def keep_live(self) -> None:
        """Somebody looks: a live view that nobody looks at ends after a while."""
        self._audience.look()

    def end_live(self) -> None:
        """End the live view after the shot under way; without one there is nothing to do."""
        self._live_ending.end(RunStep.STOP, "ended by the operator")

    def stop(self) -> None:
        """End the run after the shot under way, or the live view; without either there is nothing to do."""
        self._ending.end(RunStep.STOP, "stopped by the operator")
        self.end_live()

    def abort(self) -> None:
        """Light off now, from this thread, whatever acquisition waits for; the shot under way is lost.

        Raises
        ------
        DeviceError
            The generator did not take the command; acquisition goes on trying.
        """
        self._end_at_once("aborted by the operator", CauseCode.ABORTED)
        light.switch_off(self._rig)

    def leave(self, cause: str) -> None:
        """The program ends: abort what runs for this cause, and let no run start any more. The first cause stays."""
        self._left = self._left or cause
        if not self.status().resting:
            self._end_at_once(self._left, CauseCode.PROGRAM_ENDED)
            light.try_to_switch_off(self._rig)

    def acknowledge(self, cause: Cause | None = None) -> None:
        """Clear latched faults, and acknowledge a cause that waits, by default the first; the last one ends FAULT.

        Raises
        ------
        BusyError
            A run is active.
        InterlockOpen
            The interlock is the cause, and still open.
        DeviceError
            The generator does not answer, refuses, or is still armed.
        """
        seen = [cause] if cause else list(self.status().to_acknowledge[:1])
        if any(one.code is CauseCode.INTERLOCK_OPEN for one in seen):
            light.check_closed(self._rig)
        self.clear_faults()
        self._progress.acknowledge(seen)

    def clear_faults(self) -> None:
        """Clear the generator's latched faults alone; raises what ``acknowledge`` does."""
        if (state := self.status().state) is not RunState.IDLE:
            next_state(state, RunStep.ACKNOWLEDGE)
        light.acknowledge_faults(self._rig)

    def wait(self, deadline_s: float) -> RunStatus:
        """Wait until no run and no live view is under way; returns the status then, or the one at the deadline."""
        return self._progress.wait(deadline_s)

    @contextmanager
    def _starting_alone(self, step: RunStep) -> Iterator[None]:
        """Nothing else starts meanwhile; BusyError where this cannot start, not even after a live view."""
        if not self._starting.acquire(blocking=False):
            raise starts_already()
        try:
            raise_first(self._refusals_of_state(step))
            yield
        finally:
            self._starting.release()

    def _refusals_of_state(self, step: RunStep) -> Iterator[DaqError]:
        status = self.status()
        state = RunState.IDLE if status.state is RunState.LIVE else status.state
        yield from impossible(step, state, status.run_id if status.active else None)
        if self._left:
            yield coded(BusyError(f"no run starts any more: {self._left}"), RefusalCode.PROGRAM_ENDING)
        yield from not_acknowledged(status)

    def _preflight(self) -> Preflight:
        margin_bytes, hash_of = self._limits.disk_margin_bytes, self._hash_calibration
        return Preflight(self._rig, self._data_dir, self._configuration, hash_of, margin_bytes, self._folder)

    def _shooting(self, plan: RunPlan, timing: ShotTiming, ending: RunEnding) -> Shooting:
        return Shooting(self._rig, plan, timing, self._progress, self._limits, self._observers, ending)

    def _start_thread(self, thread: threading.Thread) -> None:
        self._threads = [*(one for one in self._threads if one.is_alive()), thread]
        thread.start()

    def _end_live_before(self, step: RunStep, cause: str) -> None:
        """Wait until a live view has ended; BusyError if it does not, or leaves a fault."""
        self._live_ending.end(RunStep.STOP, cause)
        limits = self._limits
        status = self._progress.wait(_ARMING_S + limits.frame_s + limits.light_off_s + limits.disarm_s)
        raise_first(chain(impossible(step, status.state), not_acknowledged(self.status())))

    def _end_at_once(self, cause: str, code: CauseCode) -> None:
        for ending in (self._ending, self._live_ending):
            ending.end(RunStep.ABORT, cause, code)

    def _prepare(self, plan: RunPlan) -> tuple[PreparedRun, RunWriter]:
        """Check the plan, and make the directory of the run: a run that is accepted always has one."""
        try:
            prepared = self._preflight().prepare(plan)
            self._end_live_before(RunStep.START, "a run starts")
            return prepared, RunWriter(prepared.run_dir, prepared.header, self._limits.disk_margin_bytes).open()
        except (StorageError, OSError) as error:
            raise coded(PlanError(f"the run cannot be stored: {error}"), RefusalCode.STORAGE) from error

    def _work(self, session: RunSession, ending: RunEnding) -> None:
        """Thread: one run from ARMING until it rests, and longer only if the disk does not take its outcome."""
        session.acquire()
        self._progress.move(ending.step or RunStep.ERROR, message=ending.cause)
        light_reason = session.disarm()
        session.close()
        step = RunStep.LIGHT_UNKNOWN if light_reason else RunStep.LIGHT_OFF
        message = ending.cause or self.status().summary
        self._progress.end(step, ending, outcome=ending.outcome, message=message)
        session.insist(self._leaving)
