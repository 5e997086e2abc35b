"""The bench at a reduced size: complete, in the stated form, and measuring what it says."""

import json
import time

import numpy as np
import pytest

from processing.reconstruction.kernels import _native
from processing.reconstruction.line_of_sight import line_of_sight
from processing.reconstruction.plan import plan_reconstruction
from processing.studies.speed_baseline import measure
from processing.studies.speed_scene import spray_images, study_cameras
from server.bench_command import QUICK
from server.cli import main


def test_bench_prints_what_the_interface_promises(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "--quick", "--json"]) == 0
    result = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert result["isa"] in _native.available_isas()
    assert result["volume"] == list(QUICK.shape)
    assert result["views"] == 4
    assert min(result["naive"].values()) > 0
    names = [kernel["name"] for kernel in result["kernels"]]
    assert len(set(names)) == len(names)
    for kernel in result["kernels"]:
        assert kernel["wall_s"] > 0
        if kernel["name"].endswith(("slice", "256^3")):
            assert 0 < kernel["ratio_to_naive"] < 1.001 * result["naive"]["mlos_cpu_s"] / kernel["cpu_s"]
            continue
        baseline = result["naive"]["smart_iteration_cpu_s" if "smart" in kernel["name"] else "mlos_cpu_s"]
        assert kernel["ratio_to_naive"] == pytest.approx(baseline / kernel["cpu_s"])
    recorder, (width_px, height_px) = result["recorder"], QUICK.image_size_px
    assert recorder["mb_per_s"] == pytest.approx(recorder["shots_per_s"] * 8 * width_px * height_px / 1e6)


def test_measure_is_the_median_of_warm_runs() -> None:
    durations_s = iter([0.05, 0.02, 0.001, 0.001])

    def work() -> None:
        until_s = time.process_time() + next(durations_s)
        while time.process_time() < until_s:
            pass

    assert measure(work, 3).cpu_s < 0.015


def test_the_spray_fills_a_part_of_the_volume() -> None:
    cameras = study_cameras(QUICK.image_size_px)
    images = spray_images(QUICK, cameras)
    for image in images:
        assert 0.01 < np.mean(image > 0) < 0.5
    volume = line_of_sight(plan_reconstruction(cameras, QUICK.grid), images)
    assert 1e-4 < np.mean(volume > 0) < 0.2
