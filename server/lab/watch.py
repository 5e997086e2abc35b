"""CalibrationWatch: does the calibration of a run still fit its shots? Check jobs tell, reconstructions ask.

A check takes seconds and shots may come faster. So one check of a run is under way at a time; when it has ended, the
newest shot that was asked for meanwhile is next. Slow runs are checked shot by shot, fast ones by a sample. The volumes
of the shot that is checked first do not wait, and say that they are not checked yet; those of all others do.

Volumes come with figures by which the exposures of a run are compared: shots in which lines of sight meet seldom are
checked too, and views that are pale beside those of the shots before are told with the volumes.
"""

import threading
from dataclasses import dataclass, field
from typing import Annotated, Any

from pydantic import Field

from daq.frozen_model import FrozenModel
from processing.analysis.near_or_far import SIGHTS, added, doubts_of
from processing.calibration.verdict import Verdict
from processing.runs.results_file import ExposureKey
from processing.runs.shots.meetings import Meeting, meetings_of, pale_views, seldom_meeting
from processing.runs.shots.shot_check import ALARM_PX, STOP_PX
from processing.runs.workbench import Latest
from server.lab.events import EventPublisher
from server.lab.jobs.job import ENDED, Job, JobKind, JobState, check_job

_TRUSTING = (JobKind.RECONSTRUCTION, JobKind.MEASUREMENT)
"""Jobs that make nothing good of a calibration that does not fit."""
_RESULTS_COMPARED, _EXPOSURES_COMPARED = 8, 400
"""Of so many results, the newest exposures are known; the others are long ago."""
_ALARMING = (Verdict.WARN, Verdict.REFUSE)
_REMEDY = (
    "The shots are kept: correct the calibration by the droplets (tomoshadow self-calibrate) or calibrate anew, "
    "choose the result, and reconstruct again."
)
_REMEDY_BEYOND = (
    "The shots are kept, but their droplets cannot correct so much: calibrate anew, choose the result, and "
    "reconstruct again."
)


class CalibrationStanding(FrozenModel):
    """What the newest check that could tell says of a calibration and a run."""

    run_id: Annotated[str, Field(description="run of the shot that was checked")]
    calibration: Annotated[str, Field(description="calibration that was checked")]
    shot: Annotated[int, Field(description="the shot that was checked")]
    verdict: Annotated[Verdict, Field(description="warn: an alarm; refuse: nothing is reconstructed")]
    moved: Annotated[str | None, Field(description="the view whose motion alone explains what is seen")]
    views: Annotated[dict[str, float], Field(description="disparity by view, px; none where it cannot be measured")]
    uncertainty_px: Annotated[dict[str, float], Field(description="of the disparity, by view")]
    problem: Annotated[str | None, Field(description="what is wrong where no disparity can be measured")] = None
    shots_checked: Annotated[int, Field(description="of this run with this calibration")]

    @property
    def worst_view(self) -> str | None:
        """The view that has moved; where that is not clear, the one that disagrees most with the others, if any."""
        return self.moved or max(self.views, key=lambda name: self.views[name], default=None)

    @property
    def is_alarm(self) -> bool:
        """The operator should know."""
        return self.verdict in _ALARMING

    @property
    def message(self) -> str:
        """What is wrong and how to mend it."""
        if self.problem:
            return f"{self._misfit}: {self.problem}. {_REMEDY_BEYOND}"
        limit = f"stop above {STOP_PX:g} px" if self.verdict is Verdict.REFUSE else f"alarm above {ALARM_PX:g} px"
        moved = f"{self.moved} has moved; " if self.moved else ""
        views = ", ".join(f"{name} {disparity_px:.2f}" for name, disparity_px in self.views.items())
        return f"{self._misfit}: {moved}views are off the others by {views} px ({limit}). {_REMEDY}"

    @property
    def _misfit(self) -> str:
        return f"calibration {self.calibration} does not fit run {self.run_id}, shot {self.shot}"


Pair = tuple[str, str]
"""Run and calibration."""


@dataclass
class _Account:
    """What is known of a run and the content of a calibration."""

    content: str
    is_asked: bool = False
    under_way: int | None = None
    next_shot: int | None = None
    has_ended: bool = False
    asked: set[int] = field(default_factory=set)
    odd: set[int] = field(default_factory=set)
    told: set[int] = field(default_factory=set)
    standing: CalibrationStanding | None = None
    newest: dict[str, Any] | None = None
    worst: dict[str, Any] | None = None
    sights: dict[str, int] = field(default_factory=dict)
    results_id: str | None = None

    def note(self, job: Job) -> None:
        """Keep what a check that has ended says: the newest, and the worst of those that tell."""
        self.newest = job.result or {"shot": job.shot, "verdict": None, "problem": job.error or str(job.state)}
        worst = self.worst["verdict"] if self.worst else None
        verdict = self.newest["verdict"]
        if verdict and (worst is None or _badness(verdict) >= _badness(worst)):
            self.worst = self.newest


def _badness(verdict: str) -> int:
    return list(Verdict).index(Verdict(verdict))


class CalibrationWatch:
    """Keeps account of all checks; may be used from any thread.

    Parameters
    ----------
    events : EventPublisher
        Gets ``calibration_alarm`` when the verdict on a run changes for the worse, or back.
    """

    def __init__(self, events: EventPublisher) -> None:
        self._events = events
        self._lock = threading.Lock()
        self._accounts: dict[Pair, _Account] = {}
        self._meetings: Latest[dict[ExposureKey, Meeting]] = Latest(_RESULTS_COMPARED)
        self.standing: CalibrationStanding | None = None
        """Of the run that was checked last."""

    def next_check(self, run_id: str, calibration: str, shot: int, content: str = "") -> Job | None:
        """Job that checks a shot; None while another one of this run is under way, the shot then comes after it.

        What was known of another content of a calibration of that name is forgotten.
        """
        with self._lock:
            account = self._account(run_id, calibration, content)
            account.is_asked = True
            if account.under_way is not None:
                account.next_shot = shot
                return None
            job = check_job(run_id, shot, calibration, content)
            account.under_way, account.next_shot = shot, None
            account.asked.add(shot)
            return job

    def learn(self, job: Job) -> Job | None:
        """Take notice of the state of a job; returns the check that follows it, if any."""
        if job.kind is JobKind.RECONSTRUCTION and job.state is JobState.DONE:
            return self._check_of_odd(job)
        if job.kind is not JobKind.CHECK:
            return None
        content = str(job.settings.get("content", ""))
        with self._lock:
            known = self._accounts.get((job.run_id, job.calibration))
            if known is not None and known.is_asked and known.content != content:
                return None  # of a calibration that has been replaced meanwhile
            account = self._account(job.run_id, job.calibration, content)
            if job.state not in ENDED:
                account.under_way = job.shot
                return None
            account.under_way, account.has_ended = None, True
            account.note(job)
            before, account.standing = account.standing, self._judged(account, job)
            following = account.next_shot
        self._tell(before, account.standing)
        if following is None:
            return self._check_of_odd(job)
        return self.next_check(job.run_id, job.calibration, following, content)

    def _check_of_odd(self, job: Job) -> Job | None:
        """The check of a shot in which lines of sight meet seldom; none while another shot waits to be checked."""
        with self._lock:
            account = self._accounts.get((job.run_id, job.calibration))
            if account is None or account.next_shot is not None:
                return None
            if job.kind is JobKind.RECONSTRUCTION:
                account.results_id = job.results_id
            seldom = seldom_meeting(self._meetings.known((job.run_id, account.results_id)) or {})
            odd = next((shot for shot in seldom if shot not in account.asked), None)
            if odd is None:
                return None
            account.odd.add(odd)
        return self.next_check(job.run_id, job.calibration, odd, account.content)

    def compared(self, job: Job, result: dict[str, Any]) -> dict[str, Any]:
        """What came of a job, with what other shots say of it: of checks, together; of volumes, of the same results."""
        if job.kind is JobKind.CHECK:
            return self._with_depth(job, result)
        own = meetings_of(result.get("volumes", []))
        if not own:
            return result
        with self._lock:
            known = self._meetings.of((job.run_id, job.results_id), dict)
            known |= own
            for exposure in list(known)[:-_EXPOSURES_COMPARED]:
                del known[exposure]
            pale = pale_views(known)
        volumes = [
            {**one, "odd_light": {**pale.get((one["shot"], one["frame"]), {}), **one["odd_light"]}}
            for one in result["volumes"]
        ]
        return {**result, "volumes": volumes}

    def _with_depth(self, job: Job, result: dict[str, Any]) -> dict[str, Any]:
        """A check that is refused if all shots together say that depth is reversed, whatever it says by itself."""
        with self._lock:
            account = self._accounts.get((job.run_id, job.calibration))
            if account is None or account.content != job.settings.get("content", ""):
                return result
            account.sights = added([account.sights, result.get(SIGHTS, {})])
            doubts = doubts_of(account.sights)
        if not doubts or result["verdict"] == Verdict.REFUSE:
            return result
        nothing: dict[str, Any] = {"moved": None, "views": {}, "uncertainty_px": {}}
        return {**result, **nothing, "verdict": Verdict.REFUSE, "problem": doubts[0]}

    def belonging(self, job: Job) -> dict[str, Any] | None:
        """What checks have said so far of run and calibration of a job that trusts them; None of every other job.

        ``verdict`` is the worst of those that tell, null where none does; ``shots`` has that check, and the newest.
        """
        if job.kind not in _TRUSTING:
            return None
        with self._lock:
            account = self._accounts.get((job.run_id, job.calibration), _Account(""))
            asked = {one["shot"]: one for one in (account.worst, account.newest) if one is not None}
            return {"verdict": account.worst["verdict"] if account.worst else None, "shots": list(asked.values())}

    def holds(self, job: Job) -> bool:
        """Whether a job that trusts the calibration has to wait: the first check of it on this run is under way."""
        checked = self._first_checked(job)
        return checked is not None and checked != job.shot

    def goes_ahead(self, job: Job) -> bool:
        """Whether a job comes before that first check, as it is of the same shot: nobody shall wait for its volumes."""
        checked = self._first_checked(job)
        return checked is not None and checked == job.shot

    def _first_checked(self, job: Job) -> int | None:
        """The shot whose check is under way and tells a job, as the first one, whether to trust the calibration."""
        account = self._accounts.get((job.run_id, job.calibration))
        return None if account is None or account.has_ended or job.kind not in _TRUSTING else account.under_way

    def refusal(self, job: Job) -> str | None:
        """Why a job that trusts the calibration must not be done; None if it may."""
        account = self._accounts.get((job.run_id, job.calibration))
        standing = account.standing if account else None
        refused = standing is not None and standing.verdict is Verdict.REFUSE
        return standing.message if standing and refused and job.kind in _TRUSTING else None

    def _account(self, run_id: str, calibration: str, content: str) -> _Account:
        known = self._accounts.get((run_id, calibration))
        if known is None or known.content != content:
            known = self._accounts[run_id, calibration] = _Account(content)
        return known

    def _judged(self, account: _Account, job: Job) -> CalibrationStanding | None:
        """Standing after a check; droplets that do not tell change nothing, nor does a shot before the newest one."""
        result = job.result if job.state is JobState.DONE else None
        if not result or result.get("verdict") is None:
            return account.standing
        shot: int = result["shot"]
        account.told.add(shot)
        if shot in account.odd or (account.standing and account.standing.shot > shot):
            return account.standing  # what is so of one shot alone stops no others
        return CalibrationStanding(
            run_id=job.run_id,
            calibration=job.calibration,
            shot=shot,
            verdict=result["verdict"],
            moved=result["moved"],
            views=result["views"],
            uncertainty_px=result["uncertainty_px"],
            problem=result.get("problem"),
            shots_checked=len(account.told),
        )

    def _tell(self, before: CalibrationStanding | None, now: CalibrationStanding | None) -> None:
        if now is None:
            return
        self.standing = now
        was = before.verdict if before is not None and before.is_alarm else None
        if (now.verdict if now.is_alarm else None) is not was:
            self._events.publish(
                "calibration_alarm",
                run=now.run_id,
                calibration=now.calibration,
                shot=now.shot,
                verdict=now.verdict,
                view=now.worst_view,
                disparity_px=now.views.get(now.worst_view or ""),
                message=now.message if now.is_alarm else None,
            )
