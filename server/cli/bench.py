"""``tomoshadow bench``: how fast kernels, recorder, commands and server are on this machine."""

import os
import tempfile
import time
from argparse import Namespace
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from processing.errors import BadInput
from server.cli.options import Verbs, add_verb
from server.cli.output import Outcome, progress, table

if TYPE_CHECKING:
    from collections.abc import Iterator

    from processing.benchmarks.scene import SpeedStudy
    from processing.benchmarks.speed import SpeedResult
    from processing.benchmarks.targets import Measured

MISTUNED = ("OPENBLAS_CORETYPE", "OPENBLAS_L2_SIZE")
"""Variables that change the speed of the numpy baseline."""
TABLE_BEGIN, TABLE_END = "<!-- bench -->", "<!-- /bench -->"
RECORDED_SHOTS = 24
RECORDER_DEADLINE_S = 120.0
QUICK_SHOTS = 3
PARTS = ("kernels", "recorder", "previews", "average", "slices", "jobs", "cameras", "trigger", "start", "desk")
"""In this order; each can be measured alone."""


class BenchError(BadInput):
    """The table has no place to go; the text names the file."""


def add(verbs: Verbs) -> None:
    """Add the command."""
    parser = add_verb(verbs, "bench", bench, "speed of kernels and recorder against plain numpy and OpenCV")
    parser.add_argument("--quick", action="store_true", help="a small volume; the figures mean little")
    parser.add_argument("--only", nargs="+", choices=PARTS, metavar="PART", help=f"some of {', '.join(PARTS)}")
    parser.add_argument("--directory", type=Path, help="where the recorder writes; default: the temporary directory")
    parser.add_argument(
        "--table",
        type=Path,
        help="Markdown file whose table, between <!-- bench --> marks, to renew; with --only, those lines",
    )


def bench(options: Namespace) -> Outcome:
    """Measure, and renew the table, or some lines of it."""
    from processing.benchmarks.targets import markdown_table, renewed
    from server.cli.benchmarks.machine import measured_on

    before, old, after = split_at_table(options.table) if options.table else ("", "", "")
    for name in MISTUNED:
        if name in os.environ:
            progress(f"{name} is set: the baseline is not what others measure; unset it")
    load, found = os.getloadavg()[0], _Found()
    for part in options.only or PARTS:
        progress(part)
        _measure(part, options, found)
    how, table = measured_on(load), markdown_table(found.measured)
    if options.table:
        whole = (
            f"{renewed(old, found.measured)}\n\n{_stated(old, options.only, how)}"
            if options.only
            else f"{table}\n\n{how}"
        )
        options.table.write_text(f"{before}\n{whole}\n\n{after}")
    lines = [*found.texts[:1], table, *found.texts[1:], how]
    return Outcome(
        {**found.result, "targets": [_target_json(one) for one in found.measured], "how": how}, "\n\n".join(lines)
    )


def _stated(old: str, parts: list[str], how: str) -> str:
    """What the lines of these parts were measured on, beside what was said of others."""
    which = f"Of these, {', '.join(parts)}: "
    others = [line for line in old.splitlines() if line and not line.startswith(("|", which))]
    return "\n\n".join([*others, which + how])


@dataclass
class _Found:
    """What the parts have measured so far: for the table, for programs, for people."""

    measured: list["Measured"] = field(default_factory=list)
    result: dict[str, Any] = field(default_factory=dict)
    texts: list[str] = field(default_factory=list)


def _measure(part: str, options: Namespace, found: _Found) -> None:
    from processing.benchmarks.scene import QUICK, SpeedStudy

    study = QUICK if options.quick else SpeedStudy()
    if part == "kernels":
        from processing.benchmarks.speed import speed_study

        speed = speed_study(study, progress)
        found.result |= _speed_json(speed)
        found.texts.append(_kernel_table(speed))
        found.measured += speed.targets
    elif part == "recorder":
        recorder = _recorder_speed(options.directory, study.image_size_px)
        found.result["recorder"] = recorder
        found.texts.append(f"recorder: {recorder['shots_per_s']:.1f} shots/s, {recorder['mb_per_s']:.0f} MB/s")
    else:
        found.measured += _of_programs(part, study, options)


def _of_programs(part: str, study: "SpeedStudy", options: Namespace) -> "Iterator[Measured]":
    from server.cli.benchmarks import chain_on_disk, desk, recorded_shots, served
    from server.cli.benchmarks.recorded_run import record_run

    directory, quick = options.directory, options.quick
    if part == "cameras":
        yield from recorded_shots.recorded_shots(directory, 2 if quick else 40)
    elif part == "start":
        yield from served.server_start(directory, 20 if quick else served.RUNS)
    elif part == "desk":
        yield from desk.desk(directory, 3 if quick else desk.LOOKED_S)
    elif part == "trigger":
        yield from served.trigger_to_volume(directory, 2 if quick else served.TRIGGERED_SHOTS)
    else:
        with tempfile.TemporaryDirectory(dir=directory) as folder:
            run = record_run(Path(folder), study, QUICK_SHOTS if quick else chain_on_disk.SHOTS)
            yield from getattr(chain_on_disk, part)(run, Path(folder), study.threads)


def _speed_json(result: "SpeedResult") -> dict[str, Any]:
    """The JSON object of a speed study."""
    return {
        "isa": result.isa,
        "volume": list(result.volume),
        "views": result.views,
        "naive": {"mlos_cpu_s": result.naive_mlos_cpu_s, "smart_iteration_cpu_s": result.naive_smart_iteration_cpu_s},
        "kernels": [asdict(kernel) for kernel in result.kernels],
    }


def _target_json(one: "Measured") -> dict[str, Any]:
    stated = {"measured": one.value, "reached": one.target.verdict(one.value), "how": one.how}
    return asdict(one.target) | stated | (asdict(one.timing) if one.timing else {})


def split_at_table(report: Path) -> tuple[str, str, str]:
    """What a Markdown file says before its table, mark included, in its place, and after.

    Raises
    ------
    BenchError
        The file marks no place for the table.
    """
    before, begin, rest = report.read_text().partition(TABLE_BEGIN + "\n")
    old, end, after = rest.partition(TABLE_END + "\n")
    if not begin or not end:
        raise BenchError(f"{report}: no lines {TABLE_BEGIN} and {TABLE_END} to put the table between")
    return before + begin, old, end + after


def _kernel_table(result: "SpeedResult") -> str:
    """A line per kernel, for people."""
    rows = [
        [kernel.name, f"{kernel.wall_s:.4f}", f"{kernel.cpu_s:.4f}", f"{kernel.ratio_to_naive:.1f}"]
        for kernel in result.kernels
    ]
    return table(["kernel", "wall s", "CPU s", "times naive"], rows)


def _recorder_speed(directory: Path | None, image_size_px: tuple[int, int], views: int = 4) -> dict[str, float]:
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
