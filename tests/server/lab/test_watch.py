"""Checks of shots raise an alarm, stop reconstruction, and let it go on when a calibration fits again."""

from collections.abc import Sequence

import pytest

from processing.analysis.near_or_far import AS_SEEN
from processing.calibration.fit.health import judge
from processing.calibration.verdict import Verdict
from processing.runs.shots.shot_check import ALARM_PX
from server.lab.events import EventPublisher
from server.lab.jobs.job import Job, JobKind, JobState, check_job, reconstruction_job
from server.lab.watch import CalibrationWatch

RUN, CALIBRATION = "run", "cal"


def reconstruction(shot: int = 0, calibration: str = CALIBRATION) -> Job:
    return reconstruction_job(RUN, shot, calibration, "mlos-0", {"method": "mlos"})


def ended(shot: int, disparity_px: float | None, state: JobState = JobState.DONE) -> Job:
    """A check that found view2 off by so much; None: the droplets do not tell."""
    views = {} if disparity_px is None else {"view1": 0.01, "view2": disparity_px}
    verdict = None if disparity_px is None else judge(disparity_px)
    moved = "view2" if disparity_px and disparity_px > ALARM_PX else None
    uncertainty_px = dict.fromkeys(views, 0.01)
    result = {"shot": shot, "verdict": verdict, "moved": moved, "views": views, "uncertainty_px": uncertainty_px}
    return check_job(RUN, shot, CALIBRATION).model_copy(update={"state": state, "result": result})


def lost(shot: int, moved: str | None) -> Job:
    """A check that found a view out of range: refused without a figure."""
    result = {
        "shot": shot,
        "verdict": Verdict.REFUSE,
        "moved": moved,
        "views": {},
        "uncertainty_px": {},
        "problem": f"{moved or 'a view'} has moved further than 3 px",
    }
    return check_job(RUN, shot, CALIBRATION).model_copy(update={"state": JobState.DONE, "result": result})


def watch_of(disparities_px: Sequence[float | None]) -> tuple[CalibrationWatch, EventPublisher]:
    """A watch after checks of one shot after the other."""
    events = EventPublisher()
    watch = CalibrationWatch(events)
    for shot, disparity_px in enumerate(disparities_px):
        assert watch.next_check(RUN, CALIBRATION, shot) is not None
        watch.learn(ended(shot, disparity_px))
    return watch, events


@pytest.mark.parametrize(
    ("disparity_px", "verdict", "alarms", "refused"),
    [
        (0.04, Verdict.GOOD, False, False),
        (0.3, Verdict.USABLE, False, False),
        (0.31, Verdict.WARN, True, False),
        (0.8, Verdict.WARN, True, False),
        (0.81, Verdict.REFUSE, True, True),
    ],
)
def test_limits_are_those_of_the_check(disparity_px: float, verdict: Verdict, alarms: bool, refused: bool) -> None:
    watch, events = watch_of([disparity_px])
    assert watch.standing is not None
    assert (watch.standing.verdict, watch.standing.worst_view) == (verdict, "view2")
    assert watch.standing.is_alarm is alarms
    assert [event.name for event in events.since(0)] == ["calibration_alarm"] * alarms
    assert (watch.refusal(reconstruction(5)) is not None) is refused


def test_a_refusal_names_run_shot_views_limit_and_remedy() -> None:
    watch, _ = watch_of([1.234])
    refusal = watch.refusal(reconstruction())
    assert refusal is not None
    for part in (
        "calibration cal",
        "run run, shot 0",
        "view2 has moved",
        "view2 1.23",
        "stop above 0.8 px",
        "self-calibrate",
        "kept",
    ):
        assert part in refusal
    assert watch.refusal(reconstruction(calibration="another")) is None
    assert watch.refusal(check_job(RUN, 1, CALIBRATION)) is None


@pytest.mark.parametrize("moved", ["view2", None])
def test_a_view_out_of_range_stops_although_nothing_is_measured(moved: str | None) -> None:
    watch, events = watch_of([0.1])
    watch.learn(lost(1, moved))
    refusal = watch.refusal(reconstruction())
    assert refusal is not None
    assert f"shot 1: {moved or 'a view'} has moved further than 3 px. The shots are kept" in refusal
    assert "calibrate anew" in refusal
    assert "px (" not in refusal
    (alarm,) = events.since(0)
    assert (alarm.data["verdict"], alarm.data["view"], alarm.data["disparity_px"]) == ("refuse", moved, None)
    assert alarm.data["message"] == refusal
    watch.learn(ended(2, None))
    assert watch.refusal(reconstruction()) == refusal
    watch.learn(ended(3, 0.1))
    assert watch.refusal(reconstruction()) is None


def test_the_newest_shot_that_tells_decides_and_a_change_is_told_once() -> None:
    watch, events = watch_of([0.9, 0.9, None, 0.1, 0.4])
    told = [(event.data["shot"], event.data["verdict"]) for event in events.since(0)]
    assert told == [(0, "refuse"), (3, "usable"), (4, "warn")]
    watch.learn(ended(1, 0.9))
    assert watch.standing is not None
    assert (watch.standing.shot, watch.standing.shots_checked) == (4, 4)


def test_one_check_at_a_time_and_the_newest_shot_is_next() -> None:
    watch = CalibrationWatch(EventPublisher())
    first = watch.next_check(RUN, CALIBRATION, 0)
    assert first is not None
    assert [watch.next_check(RUN, CALIBRATION, shot) for shot in (1, 2, 3)] == [None] * 3
    following = watch.learn(ended(0, 0.1))
    assert following is not None
    assert following.shot == 3
    assert watch.learn(ended(3, 0.1)) is None
    assert watch.next_check(RUN, CALIBRATION, 4) is not None


@pytest.mark.parametrize("state", [JobState.DONE, JobState.FAILED, JobState.ABORTED])
def test_reconstructions_wait_for_the_first_check_however_it_ends(state: JobState) -> None:
    watch = CalibrationWatch(EventPublisher())
    assert not watch.holds(reconstruction())
    watch.next_check(RUN, CALIBRATION, 0)
    assert watch.holds(reconstruction(1))
    assert not watch.holds(check_job(RUN, 0, CALIBRATION))
    assert not watch.holds(reconstruction(1, calibration="another"))
    watch.learn(ended(0, None, state))
    assert not watch.holds(reconstruction(1))
    watch.next_check(RUN, CALIBRATION, 1)
    assert not watch.holds(reconstruction(0))


def test_the_shot_that_is_checked_first_goes_ahead_and_is_not_checked_yet() -> None:
    watch = CalibrationWatch(EventPublisher())
    assert not watch.goes_ahead(reconstruction(3))
    watch.next_check(RUN, CALIBRATION, 3)
    assert (watch.holds(reconstruction(3)), watch.goes_ahead(reconstruction(3))) == (False, True)
    assert (watch.holds(reconstruction(0)), watch.goes_ahead(reconstruction(0))) == (True, False)
    assert watch.belonging(reconstruction(3)) == {"verdict": None, "shots": []}
    assert not watch.goes_ahead(check_job(RUN, 3, CALIBRATION))
    watch.learn(ended(3, 0.9))
    assert not watch.goes_ahead(reconstruction(3))
    assert watch.refusal(reconstruction(3)) is not None


def test_a_failed_check_says_nothing() -> None:
    watch, events = watch_of([])
    watch.learn(ended(0, 2.0, JobState.FAILED))
    assert watch.standing is None
    assert events.newest == 0


def test_checks_of_an_earlier_life_of_the_server_still_stop_a_run() -> None:
    watch = CalibrationWatch(EventPublisher())
    for job in (ended(0, 0.1), ended(1, 0.95), check_job(RUN, 2, CALIBRATION)):
        watch.learn(job)
    assert watch.refusal(reconstruction(3)) is not None
    assert watch.next_check(RUN, CALIBRATION, 3) is None


def test_a_job_is_told_the_worst_and_the_newest_of_what_was_found() -> None:
    watch, _ = watch_of([0.04, 0.5, 0.1, None])
    assert watch.belonging(reconstruction(2)) == {
        "verdict": Verdict.WARN,
        "shots": [ended(1, 0.5).result, ended(3, None).result],
    }
    assert watch.belonging(check_job(RUN, 0, CALIBRATION)) is None
    assert watch.belonging(reconstruction(calibration="other")) == {"verdict": None, "shots": []}


def test_droplets_that_do_not_tell_are_no_verdict() -> None:
    watch, _ = watch_of([None])
    told = watch.belonging(reconstruction())
    assert told == {"verdict": None, "shots": [ended(0, None).result]}


def test_another_content_of_the_same_name_is_checked_anew() -> None:
    watch, _ = watch_of([0.9])
    assert watch.refusal(reconstruction(1)) is not None
    anew = watch.next_check(RUN, CALIBRATION, 0, content="cal-2")
    assert anew is not None
    assert anew.id != check_job(RUN, 0, CALIBRATION).id
    assert (watch.refusal(reconstruction(1)), watch.holds(reconstruction(1))) == (None, True)
    watch.learn(ended(0, 0.9))
    assert watch.holds(reconstruction(1))  # a check of what was replaced tells nothing
    watch.learn(anew.model_copy(update={"state": JobState.DONE, "result": ended(0, 0.1).result}))
    told = watch.belonging(reconstruction(1))
    assert (told or {})["verdict"] == judge(0.1)


def test_after_a_start_the_newest_content_counts() -> None:
    watch, _ = watch_of([])
    for content, disparity_px in (("cal-1", 0.9), ("cal-2", 0.1)):
        check = check_job(RUN, 0, CALIBRATION, content)
        watch.learn(check.model_copy(update={"state": JobState.DONE, "result": ended(0, disparity_px).result}))
    assert watch.refusal(reconstruction(1)) is None


def made(watch: CalibrationWatch, shot: int, droplets: int = 40, contrast: float = 0.9) -> tuple[Job | None, str]:
    """Volumes of a shot come: the check that follows, and what is odd with view2."""
    meeting = {"droplets": droplets, "contrasts": {"view2": contrast}, "errors": {"view2": 0.01}}
    volume = {"shot": shot, "frame": "a", "odd_light": {}, "meeting": meeting}
    result = watch.compared(reconstruction(shot), {"volumes": [volume]})
    done = reconstruction(shot).model_copy(update={"state": JobState.DONE, "result": result})
    return watch.learn(done), result["volumes"][0]["odd_light"].get("view2", "")


def test_a_shot_in_which_lines_of_sight_meet_seldom_is_checked_and_stops_no_others() -> None:
    watch, _ = watch_of([0.1])
    assert [made(watch, shot)[0] for shot in range(4)] == [None] * 4
    odd, _ = made(watch, 4, droplets=3)
    assert odd is not None
    assert (odd.kind, odd.shot) == (JobKind.CHECK, 4)
    assert made(watch, 5, droplets=2)[0] is None, "one check at a time"
    following = watch.learn(ended(4, 2.0))
    assert following is not None
    assert following.shot == 5
    assert watch.refusal(reconstruction(6)) is None
    assert (watch.belonging(reconstruction(6)) or {})["verdict"] == Verdict.REFUSE
    assert watch.learn(ended(5, 2.0)) is None
    assert made(watch, 6)[0] is None, "each of them once"


def test_every_shot_that_stands_out_is_checked_one_after_the_other() -> None:
    """Their volumes come before the first of their checks has ended, and none comes afterwards."""
    watch, _ = watch_of([0.1])
    for shot in range(8):
        made(watch, shot)
    following, *_ = [made(watch, shot, droplets=shot - 6)[0] for shot in range(8, 13)]
    asked = list[int]()
    while following is not None:
        assert following.shot is not None
        asked.append(following.shot)
        following = watch.learn(ended(following.shot, 2.0))
    assert sorted(asked) == [8, 9, 10, 11, 12]


def test_runs_without_volumes_make_nobody_forget_volumes() -> None:
    """The newest eight results are compared; checks of runs that have none take the place of no others."""
    watch, _ = watch_of([0.1])
    for shot in range(4):
        made(watch, shot)
    for number in range(8):
        watch.learn(ended(0, 0.1).model_copy(update={"run_id": f"without volumes {number}"}))
    odd, _ = made(watch, 4, droplets=3)
    assert odd is not None


def test_a_view_that_is_pale_is_told_with_the_volumes_of_its_shot() -> None:
    watch, _ = watch_of([])
    assert [made(watch, shot)[1] for shot in range(3)] == [""] * 3
    assert made(watch, 3, contrast=0.5)[1].startswith("shows droplets with 56 % of the contrast")
    assert made(watch, 4)[1] == ""


def test_shots_of_few_droplets_tell_together_that_depth_is_reversed() -> None:
    watch, _ = watch_of([])
    verdicts = []
    for shot in range(4):
        assert watch.next_check(RUN, CALIBRATION, shot) is not None
        check = ended(shot, 0.1)
        result = {**(check.result or {}), "sights": {AS_SEEN: 19, "all images are mirrored": 47}}
        result = watch.compared(check, result)
        verdicts.append(result["verdict"])
        watch.learn(check.model_copy(update={"result": result}))
    assert verdicts == [judge(0.1), judge(0.1), Verdict.REFUSE, Verdict.REFUSE]
    refusal = watch.refusal(reconstruction(4))
    assert "all shots together: all views agree on 76 droplets within 0.25 px, and on 188 if" in (refusal or "")
