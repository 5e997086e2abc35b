"""What the list says of a run whose file does not say how it ended."""

from pathlib import Path

import pytest

from daq.causes import EXPLANATIONS, Cause, CauseCode
from daq.files.header import RunClosing
from daq.files.run_directory import RunHeader, RunWriter, ViewFormat
from daq.run.events import RunStatus
from daq.run.state import RunOutcome, RunState
from server.lab.runs.run_store import RunStore

RUN_ID = "20260101T000000-run"
HEADER = RunHeader(run_id=RUN_ID, created_utc="2026-01-01T00:00:00+00:00", views={"view1": ViewFormat((4, 4), 8)})


@pytest.mark.parametrize(
    ("status", "told"),
    [
        (RunStatus(), ("interrupted", "")),
        (RunStatus(RunState.ACQUIRING, run_id=RUN_ID, message="shot 3"), ("active", "")),
        (RunStatus(outcome=RunOutcome.FAILED, run_id=RUN_ID, message="disk full"), ("failed", "disk full")),
        (RunStatus(outcome=RunOutcome.FAILED, run_id="another", message="disk full"), ("interrupted", "")),
    ],
)
def test_a_run_without_an_outcome_is_what_acquisition_knows_of_it(
    tmp_path: Path, status: RunStatus, told: tuple[str, str]
) -> None:
    with RunWriter(tmp_path / RUN_ID, HEADER):
        pass
    summary = RunStore(tmp_path, lambda: status).summary(RUN_ID)
    assert (summary.outcome, summary.cause) == told


def test_the_causes_of_a_run_come_with_a_remedy_each(tmp_path: Path) -> None:
    cause = Cause(CauseCode.CAMERA_FAILED, "view2: control lost", "2026-01-01T00:01:00+00:00")
    with RunWriter(tmp_path / RUN_ID, HEADER) as writer:
        writer.write_closing(RunClosing("failed", cause.text, "2026-01-01T00:01:01+00:00", (cause,)))
    summary = RunStore(tmp_path, RunStatus).summary(RUN_ID)
    assert summary.ended_utc == "2026-01-01T00:01:01+00:00"
    assert [one.model_dump(mode="json") for one in summary.causes] == [
        {
            "code": "camera_failed",
            "text": "view2: control lost",
            "remedy": EXPLANATIONS[CauseCode.CAMERA_FAILED].remedy,
            "at_utc": "2026-01-01T00:01:00+00:00",
        }
    ]
