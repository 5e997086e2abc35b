"""Acquisition: one run at a time, on a thread of its own."""

import threading
from collections.abc import Callable, Mapping
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from daq.devices import Rig
from daq.errors import BusyError, PlanError
from daq.files.run_directory import open_runs
from daq.run import light
from daq.run.ending import RunControl
from daq.run.events import RunEvent, RunMessage, RunStatus, ShotRecorded, StateChanged
from daq.run.limits import AcquisitionLimits
from daq.run.preflight import PreparedRun, prepare_run
from daq.run.session import RunSession, describe_run
from daq.run.state import OUTCOMES, RunState, RunStep, next_state
from daq.run_plan import RunPlan
from daq.shot import Shot


def _nobody_listens(_: RunEvent) -> None:
    """Events are for who wants them."""


def _no_calibration_store(_: str) -> str | None:
    """Without a store of calibrations a run names its calibration, but not its hash."""
    return None


class Acquisition:
    """Runs plans on a rig. The rig is open; the light is off unless a run is active.

    Every method may be called from any thread; none but ``start`` and ``wait`` takes longer than a
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
    """

    def __init__(
        self,
        rig: Rig,
        data_dir: Path,
        publish: Callable[[RunEvent], None] = _nobody_listens,
        configuration: Mapping[str, Any] | None = None,
        hash_calibration: Callable[[str], str | None] = _no_calibration_store,
        limits: AcquisitionLimits | None = None,
    ) -> None:
        self._rig = rig
        self._data_dir = data_dir
        self._publish = publish
        self._configuration = dict(configuration or {})
        self._hash_calibration = hash_calibration
        self._limits = limits or AcquisitionLimits()
        self._starting = threading.Lock()
        self._changed = threading.Condition()
        self._status = RunStatus()
        self._control = RunControl()

    def __enter__(self) -> Self:
        for run_id in self.interrupted_runs():
            self._publish(RunMessage(run_id, "interrupted: its process ended before the run did"))
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self.status().active:
            self.abort()
            self.wait(self._limits.light_off_s + self._limits.disarm_s + self._limits.drain_s)

    def status(self) -> RunStatus:
        """Snapshot; never waits for a device."""
        with self._changed:
            return self._status

    def interrupted_runs(self) -> tuple[str, ...]:
        """Runs without an outcome whose process is gone: their outcome is INTERRUPTED, their shots are sound."""
        active = self.status().run_id
        return tuple(run_id for run_id in open_runs(self._data_dir) if run_id != active)

    def start(self, plan: RunPlan) -> str:
        """Check the plan and start the run; returns its id.

        Raises
        ------
        BusyError
            A run is active or just starting, or a fault waits to be acknowledged.
        PlanError
            The plan cannot run on this rig, or the disk does not hold it; the text names value and limit.
        InterlockOpen
            The light must not be switched on.
        DeviceError
            The generator has a latched fault or does not answer.
        """
        if not self._starting.acquire(blocking=False):
            raise BusyError("another run is being started")
        try:
            next_state(self.status().state, RunStep.START)
            self._control = RunControl()
            run, calibration_sha256 = self._prepare(plan)
            started = RunStatus(run_id=run.run_id, shots_planned=plan.total_shots, plan=plan)
            self._move(RunStep.START, **vars(started))
            work = partial(self._work, run, self._control, calibration_sha256)
            threading.Thread(target=work, name="acquisition", daemon=True).start()
            return run.run_id
        finally:
            self._starting.release()

    def stop(self) -> None:
        """End the run after the shot under way; without a run there is nothing to do."""
        self._control.end(RunStep.STOP, "stopped by the operator")

    def abort(self) -> None:
        """Light off now, from this thread, whatever acquisition waits for; the shot under way is lost.

        Raises
        ------
        DeviceError
            The generator did not take the command; acquisition goes on trying.
        """
        self._control.end(RunStep.ABORT, "aborted by the operator")
        light.switch_off(self._rig)

    def acknowledge(self) -> None:
        """Clear the generator's latched faults, and leave FAULT if the light is off.

        Raises
        ------
        BusyError
            A run is active.
        DeviceError
            The generator does not answer, refuses, or is still armed.
        """
        state = self.status().state
        if state is not RunState.IDLE:
            next_state(state, RunStep.ACKNOWLEDGE)
        light.acknowledge_faults(self._rig)
        if state is RunState.FAULT:
            self._move(RunStep.ACKNOWLEDGE)

    def wait(self, deadline_s: float) -> RunStatus:
        """Wait until no run is active; returns the status then, or the one at the deadline."""
        with self._changed:
            self._changed.wait_for(lambda: not self._status.active, deadline_s)
            return self._status

    def _prepare(self, plan: RunPlan) -> tuple[PreparedRun, str | None]:
        try:
            self._data_dir.mkdir(parents=True, exist_ok=True)
            run = prepare_run(self._rig, self._data_dir, plan, datetime.now(UTC))
            return run, self._hash_calibration(plan.calibration) if plan.calibration else None
        except OSError as error:
            raise PlanError(f"the run cannot be stored, or its calibration not be read: {error}") from error

    def _work(self, run: PreparedRun, control: RunControl, calibration_sha256: str | None) -> None:
        """Thread: one run from ARMING until it rests."""
        session = RunSession(self._rig, run, control, self._limits, self._say)
        session.acquire(
            self._data_dir / run.run_id,
            partial(describe_run, self._rig, run, self._configuration, calibration_sha256),
            partial(self._move, RunStep.ARMED),
            self._committed,
        )
        self._move(control.ending or RunStep.ERROR, message=control.cause)
        light_reason = session.disarm()
        session.close()
        outcome = OUTCOMES[control.ending or RunStep.ERROR]
        step = RunStep.LIGHT_UNKNOWN if light_reason else RunStep.LIGHT_OFF
        self._move(step, outcome=outcome, message=control.cause or self._summary())

    def _summary(self) -> str:
        status = self.status()
        return f"{status.shots_recorded} of {status.shots_planned} shots recorded, {status.shots_valid} valid"

    def _committed(self, shot: Shot) -> None:
        with self._changed:
            status = self._status
            recorded, valid = status.shots_recorded + 1, status.shots_valid + shot.valid
            self._status = replace(status, shots_recorded=recorded, shots_valid=valid)
            self._publish(ShotRecorded(status.run_id or "", shot.index, shot.valid))

    def _say(self, text: str) -> None:
        with self._changed:
            self._status = replace(self._status, message=text)
            self._publish(RunMessage(self._status.run_id or "", text))

    def _move(self, step: RunStep, **changes: Any) -> None:
        """Change state and tell it under one lock: events come in the order in which things happened."""
        with self._changed:
            state = next_state(self._status.state, step)
            status = self._status = replace(self._status, **{**changes, "state": state})
            self._publish(StateChanged(status.run_id or "", state, status.outcome, status.message))
            self._changed.notify_all()
