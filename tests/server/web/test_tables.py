"""What the page's tables tell of a job: the worst there is, with its reason."""

from typing import Any

import pytest

from daq.run_plan import RunKind
from server.lab.jobs import JobState, calibration_job
from server.lab.runs import RunSummary
from server.web.ui import tables
from server.web.ui.tables import job_row


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


def test_what_was_not_checked_is_told() -> None:
    assert told({"cam1": view("good", 0.02)}, ("where cam1 stands",)).endswith("good; not checked where cam1 stands")


def test_results_of_before_have_no_reasons() -> None:
    job = calibration_job("run", "cal", "pinhole")
    old = {"views": {"cam1": {"verdict": "good", "holdout_error_px": 0.03}}}
    assert job_row(job.model_copy(update={"result": old}))["detail"] == "cam1: hold-out 0.030 px, good"
    assert job_row(job)["detail"] == ""


@pytest.mark.parametrize(("valid", "colour"), [(6, "positive"), (1, "warning"), (0, "warning")])
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
    row = tables.run_row(run)
    assert (row["colour"], row["run"]) == (colour, "20261129T032014-spray")


def test_whoever_asks_for_work_is_told_what_came_of_it() -> None:
    queued = calibration_job("run", "cal", "pinhole")
    done = queued.model_copy(update={"state": JobState.DONE})
    assert tables.answer_of([done, queued]) == ("1 job is queued, see Processing", True)
    assert tables.answer_of([queued, queued]) == ("2 jobs are queued, see Processing", True)
    assert tables.answer_of([done]) == ("nothing to do: it is done already", False)
    assert tables.answer_of([]) == ("nothing to do: the run has no valid shot", False)
