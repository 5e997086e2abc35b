"""``tomoshadow bench``: how fast kernels and recorder are on this machine."""

import os
import tempfile
import time
from argparse import Namespace
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from processing.errors import BadInput
from server.cli.options import Verbs, add_verb
from server.cli.output import Outcome, progress, table

if TYPE_CHECKING:
    from processing.benchmarks.speed import SpeedResult
    from processing.benchmarks.targets import Measured

MISTUNED = ("OPENBLAS_CORETYPE", "OPENBLAS_L2_SIZE")
"""Variables that change the speed of the numpy baseline."""
TABLE_BEGIN, TABLE_END = "<!-- bench -->", "<!-- /bench -->"
RECORDED_SHOTS = 24
RECORDER_DEADLINE_S = 120.0
QUICK_SHOTS = 3


class BenchError(BadInput):
    """The table has no place to go; the text names the file."""


def add(verbs: Verbs) -> None:
    """Add the command."""
    parser = add_verb(verbs, "bench", bench, "speed of kernels and recorder against plain numpy and OpenCV")
    parser.add_argument("--quick", action="store_true", help="a small volume; the figures mean little")
    parser.add_argument("--directory", type=Path, help="where the recorder writes; default: the temporary directory")
    parser.add_argument("--table", type=Path, help="Markdown file whose table, between <!-- bench --> marks, to renew")


def bench(options: Namespace) -> Outcome:
    """Measure, and renew the table."""
    from processing.benchmarks.scene import QUICK, SpeedStudy
    from processing.benchmarks.speed import speed_study
    from processing.benchmarks.targets import markdown_table
    from server.cli.benchmarks.chain_on_disk import SHOTS, chain_on_disk

    around_table = split_at_table(options.table) if options.table else None
    for name in MISTUNED:
        if name in os.environ:
            progress(f"{name} is set: the baseline is not what others measure; unset it")
    study = QUICK if options.quick else SpeedStudy()
    speed = speed_study(study, progress)
    progress("recorder")
    recorder = recorder_speed(options.directory, study.image_size_px, speed.views)
    progress("run on disk")
    on_disk = tuple(chain_on_disk(study, options.directory, QUICK_SHOTS if options.quick else SHOTS))
    speed = replace(speed, targets=(*speed.targets, *on_disk))
    targets = markdown_table(speed.targets)
    if around_table:
        options.table.write_text(f"\n{targets}\n\n".join(around_table))
    recorded = f"recorder: {recorder['shots_per_s']:.1f} shots/s, {recorder['mb_per_s']:.0f} MB/s"
    return Outcome(speed_json(speed) | {"recorder": recorder}, f"{kernel_table(speed)}\n\n{targets}\n\n{recorded}")


def speed_json(result: "SpeedResult") -> dict[str, Any]:
    """The JSON object of a speed study."""
    return {
        "isa": result.isa,
        "volume": list(result.volume),
        "views": result.views,
        "naive": {"mlos_cpu_s": result.naive_mlos_cpu_s, "smart_iteration_cpu_s": result.naive_smart_iteration_cpu_s},
        "kernels": [asdict(kernel) for kernel in result.kernels],
        "targets": [_target_json(one) for one in result.targets],
    }


def _target_json(one: "Measured") -> dict[str, Any]:
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


def kernel_table(result: "SpeedResult") -> str:
    """A line per kernel, for people."""
    rows = [
        [kernel.name, f"{kernel.wall_s:.4f}", f"{kernel.cpu_s:.4f}", f"{kernel.ratio_to_naive:.1f}"]
        for kernel in result.kernels
    ]
    return table(["kernel", "wall s", "CPU s", "times naive"], rows)


def recorder_speed(directory: Path | None, image_size_px: tuple[int, int], views: int) -> dict[str, float]:
    """Shots and raw megabytes per second that the recorder brings safely to the disk of ``directory``."""
    import numpy as np

    from daq.files.run_directory import DoubleFrame, ExposureRecord, ImageKey, RunHeader, RunWriter, Shot, ViewFormat
    from daq.run.recorder import Recorder

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
