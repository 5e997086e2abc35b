"""What reconstruction must reach on two cores with AVX-512, and what it should: the table that ``bench`` prints."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from processing.benchmarks.baseline import Timing

Unit = Literal["x", "s", "ms", "GB", "%", "CPU-s", "cores", "requests", "Hz"]


@dataclass(frozen=True)
class Target:
    """One line of the table.

    Parameters
    ----------
    work : str
        What is done.
    unit : {"x", "s", "ms", "GB", "%", "CPU-s", "cores", "requests", "Hz"}
        ``x`` is the CPU time of the baseline over that of the kernel; more is better, as of
        cores and Hz. Else less is.
    at_least, aim : float
        Floor and goal, in that unit.
    """

    work: str
    unit: Unit
    at_least: float
    aim: float | None = None

    def verdict(self, value: float | None) -> Literal["aim", "yes", "no", ""]:
        """Whether a measured value reaches the aim, the floor, or neither; nothing of what was not measured."""
        if value is None:
            return ""
        if self.aim is not None and self._reaches(value, self.aim):
            return "aim"
        return "yes" if self._reaches(value, self.at_least) else "no"

    def _reaches(self, value: float, limit: float) -> bool:
        return value >= limit if self.unit in ("x", "cores", "Hz") else value <= limit


@dataclass(frozen=True)
class Measured:
    """A target and what was measured of it; ``how`` says what else one should know, or why there is no value."""

    target: Target
    value: float | None
    timing: Timing | None = None
    how: str = ""


MLOS_DENSE = Target("MLOS, every block", "x", 40)
MLOS_CULLED = Target("MLOS, empty blocks skipped", "x", 40, 100)
DOUBLE_EXPOSURE = {
    bits: Target(f"double exposure, 8 raw images of {bits} bit to 2 volumes", "s", 0.5, 0.15) for bits in (8, 16)
}
SLIDING_MINIMUM = Target("sliding minima, share of that CPU time", "%", 50)
SAMPLED = Target("MLOS by the exact mapping, distortion included", "x", 10, 20)
AVX2_MLOS = Target("MLOS with AVX2 only, every block", "x", 15, 25)
SMART_DENSE = Target("SMART of a double exposure, no voxel empty", "s", 15, 7)
SMART_SPARSE = Target("SMART of a double exposure, sparse spray", "s", 6, 2.5)
AVX2_SMART = Target("SMART of a double exposure with AVX2 only, no voxel empty", "s", 30, 15)
MEAN = Target("mean volume of single exposures, images in RAM", "s", 40, 12)
SLICE = Target("one slice, images in RAM", "ms", 20, 5)
REGION = Target("256^3 voxels, images in RAM", "ms", 20, 5)
VOLUME_MEMORY = Target("peak resident memory, MLOS of the whole volume", "GB", 1.6, 0.4)
SLABS_MEMORY = Target("peak resident memory, MLOS slab by slab", "GB", 1.6, 0.4)
SMART_MEMORY = Target("peak resident memory, SMART of a sparse spray, filled blocks", "GB", 1.6, 0.4)
CHAIN_CPU = Target("run on disk to previews of MLOS, per double exposure", "CPU-s", 0.7, 0.4)
CHAIN_CORES = Target("cores busy meanwhile, of two", "cores", 1.7, 1.9)
AVERAGE_CPU = Target("average, whole command", "CPU-s", 6, 3)
AVERAGE_MEMORY = Target("average, peak resident memory of the whole command", "GB", 1.5, 0.8)
FULL_SLICE = Target("slice of a volume that is not stored, of an exposure looked at before", "ms", 50, 20)
FIRST_SLICE = Target("the same, of another exposure of the run", "ms", 500, 200)
CAMERAS = {
    (bits, rate_hz): Target(
        f"four cameras 1600 x 1200 px A/B recorded at {rate_hz:g} Hz, {bits} bit, per shot, simulators included",
        "CPU-s",
        bits / 80,
        bits * 0.0075,
    )
    for bits in (8, 16)
    for rate_hz in (1.5, 4.0)
}
"""What is done at all times, whatever the rate, weighs less at the higher one, which a busy machine may not reach."""
TRIGGER = Target("trigger to volume in the API, full frames", "s", 2, 0.5)
LOOKED_AT = Target("what 3 browsers with 4 tiles at 10 Hz add to a server, of one processor", "%", 40, 25)
FIRST_PAGE = Target("first usable page of the desk", "s", 2, 1)
ASKED = Target("`/api/rig` while full frames are recorded and reconstructed, 95 % within", "ms", 50, 20)
ABORT = Target("ABORT on the page to light off, the server's main loop busy", "ms", 200, 100)
DRAG = Target("drag of a slider", "requests", 10, 5)
LIVE_VOLUME = Target("live volume of full frames at half resolution, with three slices", "Hz", 2)
START = Target("server start, 10,000 runs on disk", "s", 5, 2)
JOB = Target("what a job of the server adds to its work", "s", 0.3)


Row = tuple[str, ...]
HEADS: Row = ("work", "at least", "aim", "measured", "reached")


def renewed(table: str, measured: Sequence[Measured]) -> str:
    """A table with new lines in the place of old ones of the same work, and after those for which there was none."""
    rows = {row[0]: row for row in _rows_of(table)}
    for one, row in zip(measured, _rows(measured), strict=True):
        before = next((work for work in rows if work.startswith(one.target.work)), row[0])
        rows = {work if work != before else row[0]: old if work != before else row for work, old in rows.items()}
        rows[row[0]] = row
    return _table(list(rows.values()))


def markdown_table(measured: Sequence[Measured]) -> str:
    """All that was measured, as Markdown that people read without rendering it, too."""
    return _table(_rows(measured))


def _rows(measured: Sequence[Measured]) -> list[Row]:
    return [
        (
            f"{one.target.work} ({one.how})" if one.how else one.target.work,
            _figure(one.target.at_least, one.target),
            "" if one.target.aim is None else _figure(one.target.aim, one.target),
            _figure(one.value, one.target) + (f" ({one.timing.cpu_s:.2g} CPU-s)" if one.timing else ""),
            one.target.verdict(one.value),
        )
        for one in measured
    ]


def _rows_of(table: str) -> list[Row]:
    """Cells of all lines of a table but its heads."""
    lines = [line for line in table.splitlines() if line.startswith("|")]
    return [tuple(cell.strip() for cell in line.strip("|").split("|")) for line in lines[2:]]


def _table(rows: Sequence[Row]) -> str:
    rows = [HEADS, *rows]
    widths = [max(len(row[column]) for row in rows) for column in range(len(HEADS))]
    lines = ["| " + " | ".join(map(str.ljust, row, widths)) + " |" for row in rows]
    lines.insert(1, "| " + " | ".join("-" * width for width in widths) + " |")
    return "\n".join(lines)


def _figure(value: float | None, target: Target) -> str:
    if value is None:
        return "not measured"
    digits = f"{value:.3g}" if value < 1000 else f"{value:.0f}"
    return f"{digits}x" if target.unit == "x" else f"{digits} {target.unit}"
