"""Which ending wins when several threads end a run."""

import threading
import time

from hypothesis import given
from hypothesis import strategies as st

from daq.run.ending import RunControl
from daq.run.state import RunStep

ENDINGS = st.sampled_from([RunStep.LAST_SHOT, RunStep.STOP, RunStep.ABORT, RunStep.ERROR])


@given(st.lists(ENDINGS, min_size=1))
def test_the_first_urgent_ending_stays(steps: list[RunStep]) -> None:
    control = RunControl()
    for number, step in enumerate(steps):
        control.end(step, str(number))
    urgent = [
        (step, number)
        for number, step in enumerate(steps)
        if step is RunStep.ERROR or (step is RunStep.ABORT and steps[0] is not RunStep.LAST_SHOT)
    ]
    assert (control.ending, control.cause) == (urgent[0][0], str(urgent[0][1])) if urgent else (steps[0], "0")


def test_an_ending_wakes_whoever_waits() -> None:
    control = RunControl()
    threading.Timer(0.05, control.end, (RunStep.STOP, "enough")).start()
    began = time.monotonic()
    assert not control.wait_until(began + 10)
    assert time.monotonic() - began < 5
    assert not control.at_once
    assert control.end(RunStep.ABORT)
    assert control.at_once


def test_without_an_ending_the_wait_lasts() -> None:
    began = time.monotonic()
    assert RunControl().wait_until(began + 0.03)
    assert time.monotonic() - began >= 0.03
