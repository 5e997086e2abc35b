"""What acquisition tells the world: a snapshot on request, and events as they happen. Frozen values."""

from dataclasses import dataclass

from daq.causes import Cause
from daq.counted import counted
from daq.run.state import RunOutcome, RunState
from daq.run_plan import LivePlan, RunPlan


@dataclass(frozen=True)
class Waiting:
    """What a run or a live view waits for.

    Parameters
    ----------
    text : str
        Names device, or the shot whose time is to come.
    since_s : float
        When it began, by ``time.monotonic``.
    """

    text: str
    since_s: float


@dataclass(frozen=True)
class RunStatus:
    """Snapshot of acquisition.

    Parameters
    ----------
    state : RunState
        Where acquisition stands.
    outcome : RunOutcome | None
        How the run named by ``run_id`` ended; None while it is active and before the first one.
    run_id : str | None
        The active run, or the last one.
    shots_planned, shots_recorded, shots_valid : int
        Recorded shots are on the disk; valid ones have every exposure, with light where it belongs.
    message : str
        What happened last; the cause if the run failed.
    plan : RunPlan | None
        What the run named by ``run_id`` was asked to do; known although its directory may be gone.
    live : LivePlan | None
        What the live view shows; None in every other state.
    causes : tuple[Cause, ...]
        Why what ended last did so, run or live view; none if it was completed, and while the next one is active.
    ended_run : str
        Whose causes those are: a run id; empty: of a live view.
    to_acknowledge : tuple[Cause, ...]
        Where there was more than one cause: those that wait to be acknowledged, one by one. Nothing starts before.
    waiting : Waiting | None
        What acquisition waits for at the moment; None where it does not, or rests.
    """

    state: RunState = RunState.IDLE
    outcome: RunOutcome | None = None
    run_id: str | None = None
    shots_planned: int = 0
    shots_recorded: int = 0
    shots_valid: int = 0
    message: str = ""
    plan: RunPlan | None = None
    live: LivePlan | None = None
    causes: tuple[Cause, ...] = ()
    ended_run: str = ""
    to_acknowledge: tuple[Cause, ...] = ()
    waiting: Waiting | None = None

    @property
    def active(self) -> bool:
        """A run is under way."""
        return not self.resting and self.state is not RunState.LIVE

    @property
    def resting(self) -> bool:
        """Neither a run nor a live view is under way."""
        return self.state in (RunState.IDLE, RunState.FAULT)

    @property
    def summary(self) -> str:
        """The counts in words."""
        return f"{self.shots_recorded} of {counted(self.shots_planned, 'shot')} recorded, {self.shots_valid} valid"


@dataclass(frozen=True)
class StateChanged:
    """Acquisition moved to another state; ``run_id`` is empty at the ends of a live view, and of a fault."""

    run_id: str
    state: RunState
    outcome: RunOutcome | None
    message: str


@dataclass(frozen=True)
class ShotRecorded:
    """A shot reached the disk; ``fault`` says what is wrong with one that is not valid."""

    run_id: str
    index: int
    valid: bool
    fault: str = ""


@dataclass(frozen=True)
class RunMessage:
    """Something worth a line in the log of the run."""

    run_id: str
    text: str


RunEvent = StateChanged | ShotRecorded | RunMessage
