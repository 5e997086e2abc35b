"""The bench at a reduced size: complete, in the stated form, and measuring what it says."""

import json
import re
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from processing.benchmarks import targets as speed_targets
from processing.benchmarks.baseline import Timing, measure
from processing.benchmarks.memory import peak_memory_gb
from processing.benchmarks.scene import QUICK, dense_images, raw_exposures, sparse_images, spray_images, study_cameras
from processing.benchmarks.targets import Measured, Target, markdown_table, renewed
from processing.kernels import _native
from processing.preprocessing import Preprocessing, intensity
from processing.reconstruction.line_of_sight import line_of_sight
from processing.reconstruction.planning.plan import plan_reconstruction
from server.cli.bench import PARTS, BenchError, split_at_table
from server.cli.main import main

IN_THIS_PROCESS = [part for part in PARTS if part not in ("cameras", "trigger", "start", "desk")]
"""Servers and cameras of full size take longer than tests may."""
OF_SERVERS = {
    getattr(speed_targets, name)
    for name in ("TRIGGER", "START", "LOOKED_AT", "FIRST_PAGE", "ASKED", "ABORT", "DRAG", "LIVE_VOLUME")
}


def test_bench_prints_what_the_interface_promises(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    report = tmp_path / "report.md"
    report.write_text("before\n<!-- bench -->\nold\n<!-- /bench -->\nafter\n")
    assert main(["bench", "--quick", "--json", "--table", str(report), "--only", *IN_THIS_PROCESS]) == 0
    output, progress = capsys.readouterr()
    result = json.loads(output.splitlines()[-1])
    assert_every_target(result["targets"])
    assert_table(report.read_text(), result["targets"])
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
    assert f"recorder: {recorder['shots_per_s']:.1f} shots/s" in progress
    assert recorder["mb_per_s"] == pytest.approx(recorder["shots_per_s"] * 8 * width_px * height_px / 1e6)


def assert_every_target(measured: list[dict[str, object]]) -> None:
    """Each line of the table was measured, in its unit, and judged by its floor and aim."""
    stated = [value for value in vars(speed_targets).values() if isinstance(value, Target)]
    stated += speed_targets.DOUBLE_EXPOSURE.values()
    expected = {target.work: target for target in stated if target not in OF_SERVERS}
    if "avx2" not in _native.available_isas():
        expected = {work: target for work, target in expected.items() if "AVX2" not in work}
    assert {one["work"] for one in measured} == set(expected)
    assert len(measured) == len(expected)
    for one in measured:
        target, value = expected[str(one["work"])], one["measured"]
        assert isinstance(value, float)
        assert value > 0
        assert one["reached"] == target.verdict(value)
        if target.unit in ("s", "ms") and target is not speed_targets.JOB:  # of which the work does not count
            assert value == pytest.approx(one["wall_s"] if target.unit == "s" else 1e3 * float(str(one["wall_s"])))


def assert_table(report: str, measured: list[dict[str, object]]) -> None:
    """The table has its place, and what was said of other parts is still there."""
    lines = report.splitlines()
    assert (lines[0], lines[-1], "old" in lines) == ("before", "after", True)
    assert len([line for line in lines if line.startswith("|")]) == 2 + len(measured)


def test_lines_of_some_parts_are_renewed_in_their_place() -> None:
    old = markdown_table([Measured(Target(work, "s", 0.5), 0.2, how="old") for work in ("one", "two", "three")])
    table = renewed(old, [Measured(Target("two", "s", 0.5), 0.1, how="new"), Measured(Target("four", "s", 1), 2.0)])
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines()[2:]]
    assert [(row[0], row[3]) for row in cells] == [
        ("one (old)", "0.2 s"),
        ("two (new)", "0.1 s"),
        ("three (old)", "0.2 s"),
        ("four", "2 s"),
    ]


def test_one_part_of_the_bench_is_measured_alone(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    report = tmp_path / "report.md"
    old = markdown_table([Measured(speed_targets.MEAN, 9.0), Measured(speed_targets.FULL_SLICE, 99.0)])
    report.write_text(f"before\n<!-- bench -->\n\n{old}\n\nold\n\n<!-- /bench -->\nafter\n")
    assert main(["bench", "--quick", "--only", "slices", "--json", "--table", str(report)]) == 0
    result = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert [one["work"] for one in result["targets"]] == [speed_targets.FIRST_SLICE.work, speed_targets.FULL_SLICE.work]
    text = report.read_text()
    assert text.count("| 9 s") == 1
    assert "99 ms" not in text
    assert f"\nold\n\nOf these, slices: {result['how']}\n" in text
    assert re.match(r"Commit \S+; \d+ of \d+ processors .*; load [0-9.]+ before, [0-9.]+ after\.$", result["how"])


def test_a_figure_reaches_the_aim_the_floor_or_neither() -> None:
    faster, shorter = Target("ratio", "x", 40, 100), Target("time", "s", 0.5, 0.15)
    assert [faster.verdict(value) for value in (39.9, 40, 99.9, 100)] == ["no", "yes", "yes", "aim"]
    assert [shorter.verdict(value) for value in (0.51, 0.5, 0.16, 0.15)] == ["no", "yes", "yes", "aim"]
    assert Target("share", "%", 50).verdict(1) == "yes"


def test_the_table_states_floor_aim_figure_and_verdict() -> None:
    table = markdown_table((Measured(Target("work", "s", 0.5, 0.15), 0.2, Timing(0.2, 0.37), "8 bit"),))
    cells = [cell.strip() for cell in table.splitlines()[2].strip("|").split("|")]
    assert cells == ["work (8 bit)", "0.5 s", "0.15 s", "0.2 s (0.37 CPU-s)", "yes"]


def test_a_report_without_a_place_for_the_table_is_refused(tmp_path: Path) -> None:
    report = tmp_path / "report.md"
    report.write_text("nothing\n")
    with pytest.raises(BenchError, match=r"report\.md: no lines <!-- bench --> and <!-- /bench -->"):
        split_at_table(report)


def test_raw_exposures_become_the_intensities_they_were_made_of() -> None:
    images = spray_images(QUICK, study_cameras(QUICK.image_size_px))
    how = Preprocessing(minimum_window_px=0, noise_floor=0)
    for bits, tolerance in ((8, 0.02), (16, 0.01)):
        for image, raw in zip(images, raw_exposures(images, bits), strict=True):
            result = intensity(raw.frame, how, bits=bits, dark=raw.dark, background=raw.background)
            assert np.sqrt(np.mean((result - image) ** 2)) < tolerance


def test_scenes_are_as_dense_as_they_say() -> None:
    cameras = study_cameras(QUICK.image_size_px)
    plan = plan_reconstruction(cameras, QUICK.grid)
    sparse, spray, dense = (
        np.mean(line_of_sight(plan, draw(QUICK, cameras)) > 0) for draw in (sparse_images, spray_images, dense_images)
    )
    assert 0 < sparse < spray < 0.2
    assert dense > 0.9


def test_peak_memory_holds_the_volume_and_not_the_process_that_asked() -> None:
    ballast = np.ones(50_000_000)
    small = peak_memory_gb("volume", QUICK)
    deeper = replace(QUICK, shape=(480, 160, 200))
    larger = peak_memory_gb("volume", deeper)
    volume_gb = 9 * 2 * np.prod(QUICK.shape) / 1e9
    assert small < ballast.nbytes / 1e9
    assert volume_gb * 0.8 < larger - small < volume_gb * 2
    assert peak_memory_gb("slabs", deeper) < larger - 0.3 * volume_gb


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
