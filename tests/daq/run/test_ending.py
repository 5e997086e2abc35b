"""Which ending wins when several threads end a run."""

import threading
import time

from hypothesis import given
from hypothesis import strategies as st

from daq.run.ending import RunEnding
from daq.run.state import RunStep

ENDINGS = st.sampled_from([RunStep.LAST_SHOT, RunStep.STOP, RunStep.ABORT, RunStep.ERROR])


@given(st.lists(ENDINGS, min_size=1))
def test_the_first_urgent_ending_stays(steps: list[RunStep]) -> None:
    ending = RunEnding()
    for number, step in enumerate(steps):
        ending.end(step, str(number))
    urgent = [
        (step, number)
        for number, step in enumerate(steps)
        if step is RunStep.ERROR or (step is RunStep.ABORT and steps[0] is not RunStep.LAST_SHOT)
    ]
    assert (ending.step, ending.cause) == (urgent[0][0], str(urgent[0][1])) if urgent else (steps[0], "0")


def test_an_ending_wakes_whoever_waits() -> None:
    ending = RunEnding()
    threading.Timer(0.05, ending.end, (RunStep.STOP, "enough")).start()
    began = time.monotonic()
    assert not ending.wait_until(began + 10)
    assert time.monotonic() - began < 5
    assert not ending.at_once
    assert ending.end(RunStep.ABORT)
    assert ending.at_once


def test_without_an_ending_the_wait_lasts() -> None:
    began = time.monotonic()
    assert RunEnding().wait_until(began + 0.03)
    assert time.monotonic() - began >= 0.03
