"""What the page's tables tell of a job: the worst there is, with its reason."""

from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from daq.run_plan import RunKind
from server.lab.jobs.job import JobKind, JobState, calibration_job, reconstruction_job, shot_job
from server.lab.jobs.job_table import JobTable
from server.lab.runs.run_summary import RunSummary
from server.web.ui.asking import answer_of
from server.web.ui.calibrate.target_runs import target_row
from server.web.ui.drawer.job_panel import job_row, listed_jobs
from server.web.ui.runs.run_rows import run_row

RUN = RunSummary(
    run_id="run",
    name="run",
    kind=RunKind.CALIBRATION,
    created_utc="2026-11-29T03:20:14Z",
    outcome="completed",
    cause="",
    views=("view1",),
    frames_per_shot=2,
    shots_planned=3,
    shots_recorded=3,
    shots_valid=3,
    calibration=None,
)


def told(views: dict[str, Any], not_checked: tuple[str, ...] = ()) -> str:
    result = {"views": views, "not_checked": [{"what": what, "state": "something"} for what in not_checked]}
    job = calibration_job("run", "cal", "pinhole").model_copy(update={"state": JobState.DONE, "result": result})
    return str(job_row(job)["detail"])


def view(verdict: str, holdout_px: float | None, *reasons: str) -> dict[str, Any]:
    return {"verdict": verdict, "holdout_error_px": holdout_px, "reasons": list(reasons)}


def test_a_view_with_a_warning_is_worse_than_one_with_a_larger_error() -> None:
    assert told({"cam1": view("good", 0.04), "cam2": view("warn", 0.02, "cam2 stands elsewhere")}) == (
        "cam2: hold-out 0.020 px, warn; cam2 stands elsewhere"
    )


def test_of_equal_verdicts_the_larger_error_counts() -> None:
    assert told({"cam1": view("good", 0.02), "cam2": view("good", 0.04)}) == "cam2: hold-out 0.040 px, good"
    assert told({"cam1": view("refuse", None), "cam2": view("refuse", 9.0)}).startswith("cam1: hold-out inf px, refuse")


def test_a_calibration_can_be_used_unless_it_is_used_already() -> None:
    job = calibration_job("run", "cal", "pinhole").model_copy(update={"state": JobState.DONE})
    assert job_row(job, current="other")["actions"] == ["Use"]
    assert job_row(job, current="cal")["actions"] == []


def test_a_calibration_that_was_replaced_under_its_name_is_told_and_cannot_be_used() -> None:
    job = calibration_job("run", "cal", "pinhole").model_copy(update={"state": JobState.DONE})
    row = job_row(job, current="other", replaced=True)
    assert row["actions"] == []
    assert row["detail"] == "calibration cal was replaced since: this is of the one that had its name before"
    assert job_row(job, current="other")["detail"] == ""


def test_of_a_target_that_is_packed_no_calibration_is_offered_and_why_is_told() -> None:
    row = target_row(RUN, None)
    assert (row["actions"], row["detail"]) == (["Calibrate"], "")
    packed = {"outcome": "packed", "shots_valid": None, "cause": "so", "remedy": "do this"}
    row = target_row(RUN.model_copy(update=packed), None)
    assert (row["actions"], row["shots"], row["detail"]) == ([], "? / 3", "so: do this")


def test_a_long_queue_hides_no_work(tmp_path: Path) -> None:
    with closing(JobTable(tmp_path / "jobs.sqlite")) as jobs:
        for shot in range(100):
            jobs.add(reconstruction_job("run", shot, "cal", "mlos-1", {"method": "mlos"}))
        jobs.move(jobs.oldest(JobState.QUEUED)[0].id, JobState.RUNNING)
        listed = listed_jobs(jobs)
    assert [job.shot for job in listed[:3]] == [0, 99, 98]
    assert len({job.id for job in listed}) == len(listed)


def test_of_what_was_not_checked_only_how_much_it_is_is_told() -> None:
    """Its sentences are long, and whole on the page Calibrate."""
    long = tuple(f"whether {what} counts the right way" * 4 for what in ("z", "y"))
    assert told({"cam1": view("good", 0.02)}, long).endswith("good; not checked: 2 things, see Calibrate")
    assert told({"cam1": view("good", 0.02)}, long[:1]).endswith("good; not checked: 1 thing, see Calibrate")


def test_results_of_before_have_no_reasons() -> None:
    job = calibration_job("run", "cal", "pinhole")
    old = {"views": {"cam1": {"verdict": "good", "holdout_error_px": 0.03}}}
    assert job_row(job.model_copy(update={"result": old}))["detail"] == "cam1: hold-out 0.030 px, good"
    assert job_row(job)["detail"] == ""


@pytest.mark.parametrize(("valid", "colour"), [(6, "positive"), (1, "warning"), (0, "negative")])
def test_a_completed_run_that_lost_shots_is_not_green(valid: int, colour: str) -> None:
    run = RunSummary(
        run_id="20261129T032014-spray",
        name="spray",
        kind=RunKind.SAMPLE,
        created_utc="2026-11-29T03:20:14Z",
        outcome="completed",
        cause="",
        views=("view1",),
        frames_per_shot=2,
        shots_planned=6,
        shots_recorded=6,
        shots_valid=valid,
        calibration=None,
    )
    row = run_row(run)
    assert (row["colour"], row["id"]) == (colour, "20261129T032014-spray")


def test_an_interrupted_run_says_so_with_the_shots_that_it_has() -> None:
    run = RunSummary(
        run_id="run",
        name="run",
        kind=RunKind.SAMPLE,
        created_utc="2026-11-29T03:20:14Z",
        outcome="interrupted",
        cause="its process ended",
        views=("view1",),
        frames_per_shot=2,
        shots_planned=6,
        shots_recorded=3,
        shots_valid=2,
        calibration=None,
    )
    row = run_row(run)
    assert (row["outcome"], row["colour"], row["shots"], row["cause"]) == (
        "interrupted",
        "warning",
        "2 / 6",
        "its process ended",
    )
    active = run_row(run.model_copy(update={"outcome": "active", "shots_valid": None}))
    assert active["shots"] == "3 of 6 so far"


def test_whoever_asks_for_work_is_told_what_came_of_it() -> None:
    queued = calibration_job("run", "cal", "pinhole")
    done = queued.model_copy(update={"state": JobState.DONE})
    assert answer_of([done, queued]) == ("1 job is queued, see Jobs", True)
    assert answer_of([queued, queued]) == ("2 jobs are queued, see Jobs", True)
    assert answer_of([done]) == ("nothing to do: it is done already", False)
    assert answer_of([]) == ("nothing to do: the run has no valid shot", False)


GOOD = {"verdict": "good", "shots": [{"shot": 3, "verdict": "good"}]}


def reconstructed(belonging: dict[str, Any] | None = None, **faults: Any) -> tuple[str, str]:
    """Colour and text of a reconstruction that is done."""
    volume = {"shot": 0, "frame": "a", "file": "shot_00000_a.vtkhdf", **faults}
    result = {"views": {}, "volumes": [volume], "belonging": belonging or GOOD}
    job = reconstruction_job("run", 0, "cal", "mlos-0", {"method": "mlos"})
    row = job_row(job.model_copy(update={"state": JobState.DONE, "result": result}))
    return row["colour"], row["detail"]


def test_a_volume_whose_run_and_calibration_disagree_is_not_green() -> None:
    assert reconstructed() == ("positive", "")
    warned = {"verdict": "warn", "shots": [{"shot": 2, "verdict": "warn"}, {"shot": 3, "verdict": "good"}]}
    assert reconstructed(warned) == ("warning", "droplets speak against run and calibration: warn (shot 2)")
    silent = {"verdict": None, "shots": [{"shot": 3, "verdict": None}]}
    assert reconstructed(silent) == (
        "positive",
        "not checked whether run and calibration belong together (asked: shot 3)",
    )


def test_coarse_voxels_are_told_of_a_reconstruction() -> None:
    view = {"reason": "a voxel is 6 px wide, limit 1.5 px"}
    result = {"views": {"view1": view}, "coarse": "droplets are missed or pale", "volumes": [], "belonging": GOOD}
    job = reconstruction_job("run", 0, "cal", "mlos-0", {"method": "mlos"})
    row = job_row(job.model_copy(update={"state": JobState.DONE, "result": result}))
    assert row["detail"] == "droplets are missed or pale; view1 exact: a voxel is 6 px wide, limit 1.5 px"


@pytest.mark.parametrize(
    ("faults", "text"),
    [
        ({"blind_views": ["view2"]}, "exposure a: view2 sees nothing"),
        ({"dim_views": ["view1"]}, "exposure a: view1 uses less than 1/8"),
        ({"odd_light": {"view3": "is its own background"}}, "exposure a: view3 is its own background"),
        ({"lost_share": 0.5}, "exposure a: 50 % of the intensity is in voxels too faint for uint8"),
        ({"empty": True}, "exposure a: the volume is empty"),
    ],
)
def test_a_volume_of_odd_images_is_not_green(faults: dict[str, Any], text: str) -> None:
    colour, detail = reconstructed(None, **faults)
    assert (colour, detail[: len(text)]) == ("warning", text)


@pytest.mark.parametrize(("verdict", "colour"), [("good", "positive"), ("doubtful", "warning"), ("refused", "warning")])
def test_droplets_that_are_not_to_be_trusted_are_not_green(verdict: str, colour: str) -> None:
    job = shot_job(JobKind.MEASUREMENT, "run", 0, "cal", "droplets-0", {})
    result = {"droplets": 0, "verdict": verdict, "reasons": [], "belonging": GOOD}
    assert job_row(job.model_copy(update={"state": JobState.DONE, "result": result}))["colour"] == colour


@pytest.mark.parametrize(("verdict", "colour"), [("usable", "positive"), ("warn", "warning"), ("refuse", "warning")])
def test_a_calibration_that_is_refused_is_not_green(verdict: str, colour: str) -> None:
    job = calibration_job("run", "cal", "pinhole")
    result = {"views": {"cam1": view("good", 0.02), "cam2": view(verdict, 0.5)}}
    assert job_row(job.model_copy(update={"state": JobState.DONE, "result": result}))["colour"] == colour
