"""A run on the simulated bench whose light and triggers come from the pins of the Pico's real image."""

from pathlib import Path

import numpy as np
import pytest

from daq.files.run_directory import RunReader
from daq.run.acquisition import Acquisition
from daq.run.state import RunOutcome
from daq.run_plan import PulsePair, RunKind, RunPlan
from daq.shot import FiredTrain
from daq.simulation.laboratory import SimulatedLaboratory
from server.rig.assembly import open_rig
from server.rig.config import RigConfig, load_config

pytestmark = pytest.mark.network
SHOTS = 3


def emulated_config() -> RigConfig:
    config = load_config(Path("configs/simulated_small.toml"))
    assert config.simulation is not None
    return config.model_copy(update={"simulation": config.simulation.model_copy(update={"firmware": "emulated"})})


def test_a_run_with_the_image_of_the_pico(tmp_path: Path) -> None:
    config = emulated_config()
    current_a = {name: view.nominal_current_a for name, view in config.views.items()}
    plan = RunPlan(
        name="emulated", kind=RunKind.BACKGROUND, shots=SHOTS, rate_hz=5.0, pulse=PulsePair(current_a=current_a)
    )
    fired: list[FiredTrain] = []
    with open_rig(config) as assembled:
        assert isinstance(assembled.laboratory, SimulatedLaboratory)
        assembled.laboratory.witnesses.append(fired.append)
        with Acquisition(assembled.rig, tmp_path, observers=assembled.observers) as acquisition:
            run_id = acquisition.start(plan)
            status = acquisition.wait(60.0)
    assert (status.outcome, status.shots_valid) == (RunOutcome.COMPLETED, SHOTS), status.message
    assert [train.sequence for train in fired] == [1, 2, 3]
    with RunReader(tmp_path / run_id) as reader:
        assert reader.header.devices["pulse_generator"]["firmware"].endswith("rp2040")
        for index, train in enumerate(fired):
            shot = reader.read_shot(index)
            assert shot.fired == train, "what the pins did is what the file says"
            for view in shot.views.values():
                assert view.frame_b is not None
                assert 90 < np.median(view.frame_a) < 170
                assert 90 < np.median(view.frame_b) < 170


def test_a_target_moves_under_the_eyes_of_the_guard(tmp_path: Path) -> None:
    config = emulated_config()
    current_a = {name: view.nominal_current_a for name, view in config.views.items()}
    plan = RunPlan(
        name="emulated",
        kind=RunKind.CALIBRATION,
        shots=1,
        rate_hz=2.0,
        pulse=PulsePair(current_a=current_a),
        stage_z_mm=(-4.0, -2.0, 0.0, 2.0, 4.0),
    )
    with (
        open_rig(config) as assembled,
        Acquisition(assembled.rig, tmp_path, observers=assembled.observers) as acquisition,
    ):
        acquisition.start(plan)
        status = acquisition.wait(60.0)
    assert (status.outcome, status.shots_valid) == (RunOutcome.COMPLETED, 5), status.message
