"""The first page of the demonstration's report: conditions, and what the spray is asked for, beside the truth."""

from collections.abc import Iterator, Sequence

from processing.analysis.droplets.ghost_share import share_interval
from processing.analysis.droplets.size_statistics import mean_diameters
from processing.analysis.estimates import Estimate
from processing.analysis.spray.spray_extent import spray_extent
from processing.analysis.spray.spray_motion import spray_motion
from processing.analysis.spray.spray_sample import SpraySample
from processing.analysis.spray.spray_statistics import SprayStatistics
from processing.analysis.velocity.velocity_statistics import velocity_statistics
from processing.figures.found_figures import Placed
from processing.runs.liquid.objects import LiquidSummary
from server.demo.demo_droplets import EXPOSURES, MeasuredDroplets
from server.demo.demo_liquid import MeasuredLiquid
from server.reports.digits import digits_of_interval, three_digits
from server.reports.page import Table
from server.reports.spray_report import ReportedSpray
from server.reports.spray_tables import DENSITY, LABELS, in_percent

SIZES = ("d10_um", "d30_um", "d32_um", "d43_um", "dv10_um", "dv50_um", "dv90_um", "relative_span")
FLOW = ("flux_d32_um", "mass_flux_kg_m2_s")
CONE = ("cone_angle_deg", "cone_angle_half_deg")
NOT_TOLD = ["not told", ""]

Row = list[str]
Answer = tuple[Estimate | None, Estimate | None]
"""As measured, and in truth."""


def answers_table(droplets: MeasuredDroplets, liquid: MeasuredLiquid, spray: ReportedSpray) -> Table:
    """What is measured, how sure, and the truth."""
    told = spray.told
    rows = [
        ["break-up length [mm]", *_length(liquid.summary), f"{liquid.true_break_up_mm:.2f}"],
        *_of_sizes(droplets, told),
        *_of_motion(droplets),
        *(_row(name, *pair) for name, pair in spray_answers(droplets.truth, spray).items()),
        *_of_ghosts(droplets, told),
    ]
    return Table(["", "measured", "95 % interval", "truth"], rows)


def _of_sizes(droplets: MeasuredDroplets, told: SprayStatistics) -> Iterator[Row]:
    density = told.droplets.number_density_per_mm3
    yield [DENSITY, *_within(density), three_digits(droplets.true_density_per_mm3)]
    true = mean_diameters([droplets.truth.diameters_um], EXPOSURES)
    yield from (_row(name, *pair) for name, pair in _against(SIZES, told.droplets, true).items())


def _of_motion(droplets: MeasuredDroplets) -> Iterator[Row]:
    means_m_s = velocity_statistics([droplets.stored]).mean_m_s
    if droplets.velocities is None or means_m_s is None:
        return
    means = zip("uvw", (means_m_s.u, means_m_s.v, means_m_s.w), droplets.velocities.true_mean_m_s, strict=True)
    for name, one, true_m_s in means:
        yield [f"mean velocity {name} [m/s]", *_interval(one.value, one.low, one.high, 2), f"{true_m_s:.2f}"]
    yield ["error of a velocity component, rms [m/s]", "", "", f"{droplets.velocities.rms_m_s:.2f}"]


def spray_answers(truth: SpraySample, spray: ReportedSpray) -> dict[str, Answer]:
    """Flux and cone angles by their names, beside those of all true droplets in the box; none without an axis."""
    told, axis = spray.told, spray.asked.axis
    if axis is None:
        return {}
    flow = _against(FLOW, told.motion, spray_motion(truth, axis, spray.asked.liquid_kg_m3))
    return flow | _against(CONE, told.extent, spray_extent(truth, axis))


def _against(names: Sequence[str], measured: object, true: object) -> dict[str, Answer]:
    return {name: (getattr(measured, name, None), getattr(true, name, None)) for name in names}


def _row(name: str, told: Estimate | None, true: Estimate | None) -> Row:
    return [LABELS[name], *_within(told), three_digits(true.value) if true else ""]


def _of_ghosts(droplets: MeasuredDroplets, told: SprayStatistics) -> Iterator[Row]:
    """As the images tell it, where they do; as the truth counts it, of large ones."""
    expected, unpaired = told.droplets.ghost_share, told.unpaired_ghost_share
    counted = _counted(droplets.ghosts, droplets.found)
    yield ["ghosts among the droplets [%]", *_within(expected and in_percent(expected)), counted]
    if unpaired:
        yield ["the same, by droplets without a partner [%]", *_within(in_percent(unpaired)), ""]
    yield ["true droplets that were found [%]", "", "", _counted(droplets.found, droplets.missed)]


def _counted(chosen: Placed, others: Placed) -> str:
    """In percent, with its interval by counting; both exposures show the same droplets, and make nothing surer."""
    count, of = len(chosen), len(chosen) + len(others)
    low, high = share_interval(round(count / EXPOSURES), max(round(of / EXPOSURES), 1))
    return f"{100 * count / max(of, 1):.1f} ({100 * low:.1f} to {100 * high:.1f})"


def _length(liquid: LiquidSummary) -> Row:
    found = liquid.break_up_mm
    return _interval(found.value, found.low, found.high, 2) if found else NOT_TOLD


def _within(one: Estimate | None) -> Row:
    if one is None:
        return NOT_TOLD
    value, low, high = digits_of_interval(one.value, one.low, one.high)
    return [value, f"{low} to {high}"]


def _interval(value: float, low: float, high: float | None, digits: int) -> Row:
    upper = "beyond the field" if high is None else f"{high:.{digits}f}"
    return [f"{value:.{digits}f}", f"{low:.{digits}f} to {upper}"]
