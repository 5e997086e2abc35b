"""``tomoshadow bench``: how fast kernels and recorder are on this machine."""

import os
import tempfile
import time
from argparse import Namespace
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from daq.files.run_directory import DoubleFrame, ExposureRecord, ImageKey, RunHeader, RunWriter, Shot, ViewFormat
from daq.run.recorder import Recorder
from processing.benchmarks.scene import SpeedStudy
from processing.benchmarks.speed import SpeedResult, speed_study
from processing.benchmarks.targets import Measured, markdown_table
from processing.errors import BadInput
from server.cli.commands import progress

MISTUNED = ("OPENBLAS_CORETYPE", "OPENBLAS_L2_SIZE")
"""Variables that change the speed of the numpy baseline."""
TABLE_BEGIN, TABLE_END = "<!-- bench -->", "<!-- /bench -->"
RECORDED_SHOTS = 24
QUICK = SpeedStudy(
    (48, 160, 200),
    (320, 240),
    droplets=200,
    repeats=2,
    baseline_planes=3,
    iterations=2,
    sparse_droplets=50,
    mean_exposures=10,
)
RECORDER_DEADLINE_S = 120.0


class BenchError(BadInput):
    """The table has no place to go; the text names the file."""


def bench(options: Namespace) -> dict[str, Any]:
    """``tomoshadow bench``."""
    around_table = split_at_table(options.table) if options.table else None
    for name in MISTUNED:
        if name in os.environ:
            progress(f"{name} is set: the baseline is not what others measure; unset it")
    result = speed_study(QUICK if options.quick else SpeedStudy(), progress)
    progress("recorder")
    size_px = QUICK.image_size_px if options.quick else SpeedStudy().image_size_px
    recorder = recorder_speed(options.directory, size_px, result.views)
    table = markdown_table(result.targets)
    progress(f"{kernel_table(result)}\n\n{table}")
    if around_table:
        options.table.write_text(f"\n{table}\n\n".join(around_table))
    return speed_json(result) | {"recorder": recorder}


def speed_json(result: SpeedResult) -> dict[str, Any]:
    """The JSON object of a speed study."""
    return {
        "isa": result.isa,
        "volume": list(result.volume),
        "views": result.views,
        "naive": {"mlos_cpu_s": result.naive_mlos_cpu_s, "smart_iteration_cpu_s": result.naive_smart_iteration_cpu_s},
        "kernels": [asdict(kernel) for kernel in result.kernels],
        "targets": [_target_json(one) for one in result.targets],
    }


def _target_json(one: Measured) -> dict[str, Any]:
    stated = {"measured": one.value, "reached": one.target.verdict(one.value), "how": one.how}
    return asdict(one.target) | stated | (asdict(one.timing) if one.timing else {})


def split_at_table(report: Path) -> tuple[str, str]:
    """What a Markdown file says before and after its table, marks included.

    Raises
    ------
    BenchError
        The file marks no place for the table.
    """
    before, begin, rest = report.read_text().partition(TABLE_BEGIN + "\n")
    _old, end, after = rest.partition(TABLE_END + "\n")
    if not begin or not end:
        raise BenchError(f"{report}: no lines {TABLE_BEGIN} and {TABLE_END} to put the table between")
    return before + begin, end + after


def kernel_table(result: SpeedResult) -> str:
    """The kernels as a table for people."""
    rows = [f"{'kernel':<28}{'wall s':>9}{'CPU s':>9}{'times naive':>13}"]
    rows += [
        f"{kernel.name:<28}{kernel.wall_s:>9.4f}{kernel.cpu_s:>9.4f}{kernel.ratio_to_naive:>13.1f}"
        for kernel in result.kernels
    ]
    return "\n".join(rows)


def recorder_speed(directory: Path | None, image_size_px: tuple[int, int], views: int) -> dict[str, float]:
    """Shots and raw megabytes per second that the recorder brings safely to the disk of ``directory``."""
    width_px, height_px = image_size_px
    shape = (height_px, width_px)
    header = RunHeader(
        run_id="bench",
        created_utc=time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        views={f"view{number}": ViewFormat(shape, 8) for number in range(views)},
    )
    frame = np.random.default_rng(1).normal(200, 3, shape).clip(0, 255).astype(np.uint8)
    frames = {
        name: DoubleFrame(frame, frame, ExposureRecord(True, 1), ExposureRecord(True, 2)) for name in header.views
    }
    with tempfile.TemporaryDirectory(dir=directory) as parent, RunWriter(Path(parent) / "run", header) as writer:
        started_s = time.perf_counter()
        with Recorder(writer, depth=RECORDED_SHOTS) as recorder:
            for index in range(RECORDED_SHOTS):
                recorder.put(Shot(index, ImageKey.SAMPLE, frames))
            recorder.close(RECORDER_DEADLINE_S)
        elapsed_s = time.perf_counter() - started_s
    raw_mb = RECORDED_SHOTS * 2 * views * frame.nbytes / 1e6
    return {"shots_per_s": RECORDED_SHOTS / elapsed_s, "mb_per_s": raw_mb / elapsed_s}
