"""What waits to be acknowledged."""

from daq.causes import CauseCode
from daq.errors import DaqError
from daq.run.ending import RunEnding
from daq.run.events import RunEvent, RunMessage
from daq.run.progress import RunProgress
from daq.run.state import RunState, RunStep
from daq.run_plan import LivePlan


def test_a_fault_is_left_with_the_last_cause() -> None:
    ending, told = RunEnding(), list[RunEvent]()
    for code in (CauseCode.INTERLOCK_OPEN, CauseCode.GENERATOR_FAILED, CauseCode.LIGHT_NOT_OFF):
        ending.fail(DaqError(code), code)
    progress = RunProgress(told.append)
    progress.begin_live(LivePlan(pulse=None))
    progress.end(RunStep.LIGHT_UNKNOWN, ending)
    for state, left in ((RunState.FAULT, 2), (RunState.FAULT, 1), (RunState.IDLE, 0)):
        assert (progress.status().state, len(progress.status().to_acknowledge)) == (state, left)
        progress.acknowledge(progress.status().to_acknowledge[:1])
    assert [event.text for event in told if isinstance(event, RunMessage)] == [
        "a second cause, to be acknowledged by itself: generator_failed",
        "acknowledged: interlock_open",
        "acknowledged: generator_failed",
    ]
