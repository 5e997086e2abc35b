"""Every fault of the bench leads to the cause that the table of ``docs/operate.md`` promises, wherever it comes.

One cell of the table per kind of fault, every place and both quotas among them; ``TOMOSHADOW_ALL_FAULTS=1`` tries all.
"""

import os
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, cast

import pytest

from daq.causes import CauseCode
from daq.devices import PulseGenerator
from daq.errors import DeviceUnavailable
from daq.faults import LABORATORY_FAULTS, Fault, FaultKind
from daq.files.run_directory import ImageKey, PulsePair, RunKind, RunPlan, RunReader
from daq.run.acquisition import Acquisition
from daq.run.limits import AcquisitionLimits
from daq.shot import FiredTrain
from server.rig.assembly import open_rig
from server.rig.config import RigConfig, load_config
from tests.support.server_process import eventually
from tests.support.watched_rig import Witness

pytestmark = pytest.mark.network
ROOT = Path(__file__).parents[2]
VIEWS = ("view1", "view2")
SHOTS = 3
PLACES = {"first": 1, "middle": 2, "last": SHOTS}
QUOTAS = (0, 3)
AMOUNTS = {
    FaultKind.PACKET_LOSS: 5.0,
    FaultKind.PACKETS_DOUBLED: 30.0,
    FaultKind.PACKETS_SWAPPED: 30.0,
    FaultKind.LATE: 3.0,
    FaultKind.PULSE_B_LATE: 40_000.0,
    FaultKind.SERIAL_GARBAGE: 300.0,
}
DURATIONS_S = {FaultKind.GENERATOR_HANG: 1.5, FaultKind.GENERATOR_UNPLUGGED: 1.0}
"""They end, so that the light is known to be off when the bench is taken down."""
MOVING = (FaultKind.STAGE_STALL, FaultKind.STAGE_UNPLUGGED)
LIMITS = AcquisitionLimits(frame_s=2.0)
DEADLINE_S = 60.0


@dataclass(frozen=True)
class Cell:
    """A fault, the firing at which it comes, and how many shots may be fired again."""

    kind: FaultKind
    place: str
    quota: int

    def __str__(self) -> str:
        return f"{self.kind}-{self.place}-{self.quota}"


ALL_CELLS = [Cell(*cell) for cell in product(FaultKind, PLACES, QUOTAS)]
CELLS = [Cell(kind, list(PLACES)[n % 3], QUOTAS[n % 2]) for n, kind in enumerate(FaultKind)]


def promised(cell: Cell) -> str:
    """What the page says of a fault."""
    page = (ROOT / "docs" / "operate.md").read_text(encoding="utf-8").partition("| fault | quota 0 | quota 3 |")[2]
    for row in re.findall(r"^\|(.*)\|(.*)\|(.*)\|$", page, re.MULTILINE):
        if f"`{cell.kind}`" in row[0]:
            told = [row[1].strip(), row[1].strip() if "the same" in row[2] else row[2].strip()]
            always, _, last = told[QUOTAS.index(cell.quota)].partition("; at the last shot ")
            return (
                f"{always}, {last}"
                if last.startswith("that, or")
                else last
                if last and cell.place == "last"
                else always
            )
    raise AssertionError(f"the page does not say what {cell.kind} leads to")


class FaultyFire:
    """The generator of the bench; a fault happens just before one of its firings."""

    def __init__(self, generator: PulseGenerator, firing: int, happen: Callable[[], None]) -> None:
        self._generator = generator
        self._firing = firing
        self._happen = happen
        self.fired = 0

    def fire(self) -> FiredTrain:
        self.fired += 1
        if self.fired == self._firing:
            self._happen()
        return self._generator.fire()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._generator, name)


def small_config() -> RigConfig:
    config = load_config(ROOT / "configs" / "simulated_small.toml")
    sensor = {"width_px": 100, "height_px": 75, "pixel_pitch_um": 118.4}
    views = {name: config.views[name] for name in VIEWS}
    small = {
        name: view.model_copy(update={"sensor": view.sensor.model_copy(update=sensor)}) for name, view in views.items()
    }
    return config.model_copy(update={"views": small})


def plan_of(config: RigConfig, cell: Cell) -> RunPlan:
    """Three shots; where the stage is at fault each at another position, so that it has to move."""
    moves = cell.kind in MOVING
    return RunPlan(
        name=str(cell),
        kind=RunKind.CALIBRATION if moves else RunKind.BACKGROUND,
        shots=1 if moves else SHOTS,
        stage_z_mm=(-1.0, 0.0, 1.0) if moves else (),
        rate_hz=20.0,
        refire_quota=cell.quota,
        pulse=PulsePair(current_a={name: view.nominal_current_a for name, view in config.views.items()}),
    )


def comes_back(generator: PulseGenerator) -> bool:
    try:
        generator.recover()
    except DeviceUnavailable:
        return False
    return True


@pytest.mark.parametrize("cell", ALL_CELLS if os.environ.get("TOMOSHADOW_ALL_FAULTS") else CELLS, ids=str)
def test_a_fault_ends_a_run_as_the_page_says(cell: Cell, tmp_path: Path) -> None:
    config = small_config()
    view = None if cell.kind in LABORATORY_FAULTS else "view2"
    fault = Fault(kind=cell.kind, view=view, amount=AMOUNTS.get(cell.kind, 1.0), duration_s=DURATIONS_S.get(cell.kind))
    with open_rig(config) as bench:
        assert bench.laboratory is not None
        generator = FaultyFire(bench.rig.generator, PLACES[cell.place], partial(bench.laboratory.inject, fault))
        witness = Witness()
        rig = witness.watch(replace(bench.rig, generator=cast(PulseGenerator, generator)))
        with Acquisition(rig, tmp_path, limits=LIMITS, observers=bench.observers) as acquisition:
            if cell.kind is FaultKind.IDS_WRAP:  # between A and B of that shot; ids begin when a camera is armed
                bench.laboratory.inject(fault.model_copy(update={"amount": 2.0 * PLACES[cell.place] - 1}))
            run_id = acquisition.start(plan_of(config, cell))
            assert not acquisition.wait(DEADLINE_S).active
            eventually(lambda: comes_back(bench.rig.generator), "the generator is plugged in again")
    if darkness := witness.darkness:
        assert darkness.asked_before == ()
    reader, told = RunReader(tmp_path / run_id), promised(cell)
    codes = [cause.code for cause in reader.causes]
    if reader.outcome == "completed":
        assert told.startswith("completed") or "or completed" in told, (told, reader.cause)
        assert codes == []
    else:
        assert reader.outcome == "failed"
        assert codes[:1] == [CauseCode(code) for code in re.findall(r"`(\w+)`", told)][:1], (told, reader.cause)
    if told.startswith("completed"):
        index = PLACES[cell.place] - 1
        expected = [index] if "that shot is invalid" in told else []
        assert [n for n, key in enumerate(reader.image_keys()) if key == ImageKey.INVALID] == expected, told
        assert generator.fired == SHOTS + ("fired again" in told), told
