"""A run of droplets and its calibration, which several commands are tried on."""

from pathlib import Path

import pytest

from tests.support.droplet_run import write_calibration, write_run


@pytest.fixture
def run_dir(tmp_path: Path) -> Path:
    return write_run(tmp_path / "run", shots=3, invalid=(1,))


@pytest.fixture
def calibration_file(tmp_path: Path) -> Path:
    return write_calibration(tmp_path / "calibration.json")
