"""What every TranslationStage does, run on the serial driver with a simulated instrument behind it, and in memory."""

from collections.abc import Iterator

import pytest

from daq.devices import TranslationStage
from daq.drivers.serial_stage import SerialStage, StageScale
from daq.errors import DeviceRefused
from daq.simulation.stage import SimulatedStage
from tests.support.memory_devices import MemoryStage
from tests.support.memory_rig import MemoryRig

RANGE_MM = (-5.0, 5.0)


@pytest.fixture(params=["serial", "memory"])
def stage(request: pytest.FixtureRequest) -> Iterator[TranslationStage]:
    if request.param == "memory":
        yield MemoryStage("stage", [], MemoryRig().generator, RANGE_MM)
        return
    with SimulatedStage(speed_mm_s=500) as instrument:
        scale = StageScale(zero_mm=20.0)
        with SerialStage("stage", instrument.port, RANGE_MM, scale=scale, poll_s=0.002) as opened:
            yield opened


def test_names_itself(stage: TranslationStage) -> None:
    assert stage.name == "stage"
    assert all((stage.identity().vendor, stage.identity().model, stage.identity().serial, stage.identity().firmware))


@pytest.mark.parametrize("z_mm", [-5.0, 0.0, 1.2345, 5.0])
def test_goes_where_it_is_told_and_tells_where_it_is(stage: TranslationStage, z_mm: float) -> None:
    reached_mm = stage.move_to(z_mm)
    assert reached_mm == pytest.approx(z_mm, abs=0.0025)
    assert stage.position_mm() == reached_mm


@pytest.mark.parametrize("z_mm", [-5.001, 12.0, float("nan")])
def test_refuses_positions_outside_the_range_and_names_both(stage: TranslationStage, z_mm: float) -> None:
    before_mm = stage.position_mm()
    with pytest.raises(DeviceRefused, match=f"stage: z {z_mm:g} mm is outside the range -5 to 5 mm"):
        stage.move_to(z_mm)
    assert stage.position_mm() == before_mm


def test_repeated_positions_scatter_by_two_micrometres_at_most(stage: TranslationStage) -> None:
    reached_mm = [stage.move_to(z_mm) for z_mm in (1.0, 2.0) * 8]
    errors_um = [1000 * abs(z_mm - round(z_mm)) for z_mm in reached_mm]
    assert 0.2 < max(errors_um) < 2.05


def test_one_that_was_not_lost_stays_where_it_is(stage: TranslationStage) -> None:
    reached_mm = stage.move_to(1.0)
    stage.recover()
    assert stage.position_mm() == reached_mm
