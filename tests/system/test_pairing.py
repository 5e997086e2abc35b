"""No image passes as another one, whatever cameras and network do: every image tells firing, view and exposure."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import pytest

from daq.devices import PulseGenerator
from daq.faults import Fault, FaultKind
from daq.files.run_directory import PulsePair, RunKind, RunPlan, RunReader
from daq.run.acquisition import Acquisition
from daq.run.limits import AcquisitionLimits
from daq.shot import FiredTrain
from daq.simulation.laboratory import SimulatedLaboratory
from server.rig.assembly import AssembledRig, open_rig
from tests.support.simulated_serving import CURRENT_A, VIEWS, tiny_config
from tests.support.soak_kill import mispaired_exposures

pytestmark = pytest.mark.network
SHOTS, RATE_HZ, FRAME_S = 6, 10.0, 0.4
DEADLINE_S = 60.0
LAST_ID = 65535

STORIES: Mapping[str, Mapping[int, Sequence[Fault]]] = {
    "cameras become ready one after the other": {
        1: [Fault(kind=FaultKind.MISSED_TRIGGER, view=view) for view in VIEWS],
        3: [Fault(kind=FaultKind.MISSED_TRIGGER, view="view2")],
    },
    "frames are lost, then come in another order": {
        2: [Fault(kind=FaultKind.DROPPED_A, view="view2")],
        4: [Fault(kind=FaultKind.SWAPPED, view="view1")],
    },
    "frames come half a period and a whole one too late": {
        2: [Fault(kind=FaultKind.LATE, view="view2", amount=FRAME_S + 0.5 / RATE_HZ)],
        4: [Fault(kind=FaultKind.LATE, view="view1", amount=FRAME_S + 1 / RATE_HZ)],
    },
    "block ids wrap between A and B, and blocks and packets come twice and in another order": {
        0: [Fault(kind=FaultKind.IDS_WRAP, view="view1", amount=3), Fault(kind=FaultKind.IDS_WRAP, view="view2")],
        2: [Fault(kind=FaultKind.BLOCK_DOUBLED, view=view) for view in VIEWS],
        3: [Fault(kind=FaultKind.PACKETS_DOUBLED, view="view1", amount=50, duration_s=0.2)],
        5: [Fault(kind=FaultKind.PACKETS_SWAPPED, view="view1", amount=50, duration_s=0.2)],
    },
    "the clock of a camera goes back": {
        3: [Fault(kind=FaultKind.CLOCK_BACK, view="view2", amount=1.0)],
    },
    "the clock of a camera jumps, then it loses a frame": {
        3: [Fault(kind=FaultKind.TIMESTAMP_JUMP, view="view2", amount=5.0)],
        4: [Fault(kind=FaultKind.DROPPED_B, view="view2")],
    },
}


HARMLESS = frozenset(
    {
        FaultKind.TIMESTAMP_JUMP,
        FaultKind.IDS_WRAP,
        FaultKind.BLOCK_DOUBLED,
        FaultKind.PACKETS_DOUBLED,
        FaultKind.PACKETS_SWAPPED,
    }
)
"""No shot suffers from them."""


class StoriedFire:
    """The generator of the bench; faults happen just before some of its firings, those at 0 before the run."""

    def __init__(self, generator: PulseGenerator, laboratory: SimulatedLaboratory) -> None:
        self._generator = generator
        self._laboratory = laboratory
        self.story: Mapping[int, Sequence[Fault]] = {}
        self.fired = 0

    def fire(self) -> FiredTrain:
        self.fired += 1
        for fault in self.story.get(self.fired, ()):
            self._laboratory.inject(fault)
        return self._generator.fire()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._generator, name)


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[AssembledRig]:
    config = tiny_config(tmp_path_factory.mktemp("pairing"), subnet=10)
    assert config.simulation is not None
    numbered = config.simulation.model_copy(update={"numbered": True})
    with open_rig(config.model_copy(update={"simulation": numbered})) as opened:
        yield opened


@pytest.mark.parametrize("quota", [0, 3])
@pytest.mark.parametrize("story", STORIES)
def test_only_the_shots_that_a_fault_hits_are_invalid_and_no_image_is_another_one(
    bench: AssembledRig, tmp_path: Path, story: str, quota: int
) -> None:
    """On a busy machine a deadline is late, too: then a late frame is in time."""
    assert isinstance(bench.laboratory, SimulatedLaboratory)
    generator = StoriedFire(bench.rig.generator, bench.laboratory)
    generator.story = STORIES[story]
    rig = replace(bench.rig, generator=cast(PulseGenerator, generator))
    for fault in generator.story.get(0, ()):
        bench.laboratory.inject(fault)
    plan = RunPlan(
        name="pairing",
        kind=RunKind.BACKGROUND,
        shots=SHOTS,
        rate_hz=RATE_HZ,
        refire_quota=quota,
        pulse=PulsePair(current_a=CURRENT_A),
    )
    limits = AcquisitionLimits(frame_s=FRAME_S)
    with Acquisition(rig, tmp_path, limits=limits, observers=bench.observers) as acquisition:
        run_id = acquisition.start(plan)
        status = acquisition.wait(DEADLINE_S)
    for fault in generator.story.get(0, ()):
        bench.laboratory.inject(fault.model_copy(update={"duration_s": 0}))
    assert status.outcome == "completed", status.message
    shots = [RunReader(tmp_path / run_id).read_shot(index) for index in range(SHOTS)]
    assert [mispaired_exposures(shot, VIEWS) for shot in shots] == [0] * SHOTS
    ids = {frames.record_a.frame_id for shot in shots for frames in shot.views.values()}
    assert (LAST_ID in ids) == (0 in generator.story)
    hit = {firing - 1 for firing, faults in generator.story.items() if faults[0].kind not in HARMLESS}
    surely = {index for index in hit if generator.story[index + 1][0].kind is not FaultKind.LATE}
    refired = generator.fired - SHOTS
    if quota == 0:
        assert surely <= {shot.index for shot in shots if not shot.valid} <= hit
    else:
        assert all(shot.valid for shot in shots)
        assert sum(shot.refires for shot in shots) == refired
        assert len(surely) <= refired <= len(hit)
