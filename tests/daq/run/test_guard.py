"""The guard switches the light off, unless that has been done."""

import threading
import time

import pytest

from daq.devices import GeneratorStatus
from daq.errors import DeviceTimeout
from daq.run.events import RunEvent
from daq.run.guard import RunGuard
from daq.run.limits import AcquisitionLimits
from daq.run.progress import RunProgress
from daq.run.shooting import Shooting
from daq.run_plan import PulsePair, RunPlan
from daq.timing import plan_shot_timing
from tests.support.memory_rig import TIMING, MemoryRig

PLAN = RunPlan(name="guard", shots=1, pulse=PulsePair(current_a={"view1": 20.0, "view2": 12.0}))
DEADLINE_S = 20.0


@pytest.mark.parametrize("left", [False, True], ids=["during the run", "when it was left"])
def test_a_question_without_an_answer_switches_off_what_is_not_off_yet(
    left: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Who leaves the guard has switched off: asked in turn with him, a silent generator would cost a second more."""
    memory, told = MemoryRig(), list[RunEvent]()
    timing = plan_shot_timing(PLAN, dict.fromkeys(memory.cameras, TIMING))
    run = Shooting(memory.rig, PLAN, timing, RunProgress(told.append), AcquisitionLimits())
    guard, asked = RunGuard(run), threading.Event()

    def silent() -> GeneratorStatus:
        asked.set()
        assert not left or guard._done.wait(DEADLINE_S)
        raise DeviceTimeout("generator", "STATUS", 1.0)

    monkeypatch.setattr(memory.generator, "status", silent)
    with guard:
        assert asked.wait(DEADLINE_S)
        if not left:
            assert not run.ending.wait_until(time.monotonic() + DEADLINE_S)
    assert run.ending.cause == "generator: no answer to 'STATUS' within 1 s"
    assert memory.journal.count("off") == (0 if left else 1)
