"""The first page of the demonstration's report: conditions, and what the spray is asked for, beside the truth."""

from collections.abc import Iterator

from processing.analysis.droplets.ghost_share import share_interval
from processing.analysis.droplets.size_statistics import mean_diameters
from processing.analysis.estimates import Estimate
from processing.analysis.spray.spray_statistics import SprayStatistics
from processing.analysis.velocity.velocity_statistics import velocity_statistics
from processing.figures.found_figures import Placed
from processing.runs.liquid.objects import LiquidSummary
from server.demo.demo_droplets import COUNTED_UM, EXPOSURES, MeasuredDroplets
from server.demo.demo_liquid import MeasuredLiquid
from server.reports.digits import digits_of_interval, three_digits
from server.reports.page import Table
from server.reports.spray_tables import DENSITY, OF_DROPLETS, in_percent

SIZES = ("d10_um", "d30_um", "d32_um", "dv10_um", "dv50_um", "dv90_um", "relative_span")
NOT_TOLD = ["not told", ""]

Row = list[str]


def answers_table(droplets: MeasuredDroplets, liquid: MeasuredLiquid, told: SprayStatistics) -> Table:
    """What is measured, how sure, and the truth."""
    rows = [
        ["break-up length [mm]", *_length(liquid.summary), f"{liquid.true_break_up_mm:.2f}"],
        *_of_sizes(droplets, told),
        *_of_motion(droplets),
        *_of_ghosts(droplets, told),
    ]
    return Table(["", "measured", "95 % interval", "truth"], rows)


def _of_sizes(droplets: MeasuredDroplets, told: SprayStatistics) -> Iterator[Row]:
    density = told.droplets.number_density_per_mm3
    yield [DENSITY, *_within(density), three_digits(droplets.true_density_per_mm3)]
    true = mean_diameters([droplets.true_um], EXPOSURES)
    for name in SIZES:
        truth: Estimate | None = getattr(true, name)
        yield [OF_DROPLETS[name], *_within(getattr(told.droplets, name)), three_digits(truth.value) if truth else ""]


def _of_motion(droplets: MeasuredDroplets) -> Iterator[Row]:
    means_m_s = velocity_statistics([droplets.stored]).mean_m_s
    if droplets.velocities is None or means_m_s is None:
        return
    means = zip("uvw", (means_m_s.u, means_m_s.v, means_m_s.w), droplets.velocities.true_mean_m_s, strict=True)
    for name, one, true_m_s in means:
        yield [f"mean velocity {name} [m/s]", *_interval(one.value, one.low, one.high, 2), f"{true_m_s:.2f}"]
    yield ["error of a velocity component, rms [m/s]", "", "", f"{droplets.velocities.rms_m_s:.2f}"]


def _of_ghosts(droplets: MeasuredDroplets, told: SprayStatistics) -> Iterator[Row]:
    """As the images tell it, where they do; as the truth counts it, from 30 um on."""
    expected, unpaired = told.droplets.ghost_share, told.unpaired_ghost_share
    counted, beyond = _counted(droplets.ghosts, droplets.found), f"truth: from {COUNTED_UM:g} µm on"
    yield [f"ghosts among the droplets [%], {beyond}", *_within(expected and in_percent(expected)), counted]
    if unpaired:
        yield ["the same, by droplets without a partner [%]", *_within(in_percent(unpaired)), ""]
    found = _counted(droplets.found, droplets.missed)
    yield [f"true droplets that were found [%], {beyond}", "", "", found]


def _counted(chosen: Placed, others: Placed) -> str:
    """In percent, with its interval by counting; both exposures show the same droplets, and make nothing surer."""
    count, of = len(chosen), len(chosen) + len(others)
    low, high = share_interval(round(count / EXPOSURES), max(round(of / EXPOSURES), 1))
    return f"{100 * count / max(of, 1):.1f} ({100 * low:.1f} to {100 * high:.1f})"


def _length(liquid: LiquidSummary) -> Row:
    found = liquid.break_up_mm
    return _interval(found.value, found.low, found.high, 2) if found else ["none", liquid.break_up_reason or ""]


def _within(one: Estimate | None) -> Row:
    if one is None:
        return NOT_TOLD
    value, low, high = digits_of_interval(one.value, one.low, one.high)
    return [value, f"{low} to {high}"]


def _interval(value: float, low: float, high: float | None, digits: int) -> Row:
    upper = "beyond the field" if high is None else f"{high:.{digits}f}"
    return [f"{value:.{digits}f}", f"{low:.{digits}f} to {upper}"]
