"""Chapters on liquid that is no droplet: ligaments, sheets and break-up; and where nothing can be known."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from daq.counted import counted
from processing.analysis.droplets.droplet_file import StoredDroplets
from processing.analysis.objects.break_up import Reach
from processing.analysis.objects.connected_share import BreakUp, break_up_of, connected_share
from processing.analysis.objects.liquid_objects import LiquidObjects, ObjectClass
from processing.analysis.objects.object_sizes import MedianSizes, median_sizes
from processing.analysis.objects.seeing_views import UnseenMap
from processing.figures.object_figures import BreakUpCurve, break_up_figure, unseen_figure
from processing.geometry import FloatArray
from processing.runs.liquid.objects import objects_of, reaches_of, told_of_exposures
from server.reports.page import Picture, Section, Table
from server.reports.spray_tables import cells_of

CURVE_POINTS, BEYOND = 400, 1.25
"""Of the break-up curve, which ends so far beyond the longest length."""
CLASSES_TEXT = (
    "A ligament's longest axis is 1.8 times the next; a sheet's shortest is 1.8 times shorter than the next; a cluster "
    "is several bodies that touch, a ring or a net; the core hangs together with the nozzle. Shorter ones are droplets."
)
LIMITS_TEXT = (
    "Limits hold how shots differ, thresholds of darkness of 0.2 and 0.3, by both of which the length is told, and "
    "that bodies less than two pixels apart, or one behind the other in all views, look like one."
)
BLACK_TEXT = (
    "A line of sight with less than a tenth of its light tells nothing of what else lies on it. A droplet is believed "
    "where three views see it; what fewer see is not counted as empty: number densities are per volume that was seen."
)
NO_MAP = "There is no map: a file is of an older program, or the shots are not of the same places."


@dataclass(frozen=True, eq=False)
class ReportedLiquid:
    """What is reported of liquid that is no droplet.

    Parameters
    ----------
    reaches : sequence of Reach
        How far it hangs together with the nozzle, a shot each.
    exposures : int
        In which objects were looked for.
    by_shot : sequence of LiquidObjects
        Of all exposures of each shot.
    shown : LiquidObjects
        Of the exposure that is drawn.
    true_mm : (shots,) array | None
        Where it ends in truth, if that is known.
    """

    reaches: Sequence[Reach]
    exposures: int
    by_shot: Sequence[LiquidObjects]
    shown: LiquidObjects
    true_mm: FloatArray | None = None

    @classmethod
    def of_files(cls, shots: Sequence[StoredDroplets]) -> "ReportedLiquid | None":
        """What files of droplets say; None where nobody looked for such liquid."""
        exposures = sum(len(told_of_exposures(shot)) for shot in shots)
        if not exposures:
            return None
        first = next(shot.objects for shot in shots if told_of_exposures(shot))
        found = objects_of(shots)
        shown = found[0].where(first["frame"] == "a") if first else found[0]
        return cls(reaches_of(shots), exposures, found, shown)

    def medians(self, kind: ObjectClass) -> MedianSizes | None:
        """Of the objects of a class."""
        return median_sizes(self.by_shot, kind, self.exposures)


def break_up_section(liquid: ReportedLiquid) -> Section:
    """Numbers and sizes of objects, the break-up length with its limits or the reason why there is none, the curve."""
    found = break_up_of(liquid.reaches)
    text = f"{_break_up_text(found, liquid.true_mm)} {CLASSES_TEXT}"
    figure = break_up_figure(_curve(liquid, found), counted(found.shots, "shot"), liquid.shown)
    caption = (
        "Objects of one exposure, seen along z: ligaments as lines of their length and direction, others as circles as "
        "wide as they are long."
    )
    if found.shots:
        text += f" {LIMITS_TEXT}"
        caption = (
            "Left: share of the shots whose liquid still hangs together with the nozzle, with 95 % limits; where it "
            f"crosses a half is the break-up length. Right: {caption[0].lower()}{caption[1:]}"
        )
    return Section("Ligaments and break-up", text, [_objects_table(liquid)], [Picture(figure, caption, svg=True)])


def liquid_rows(liquid: ReportedLiquid) -> list[list[str]]:
    """Break-up length and medians of ligaments as rows of a table of figures, as far as they are told."""
    medians = liquid.medians(ObjectClass.LIGAMENT)
    sizes = [("length", medians.length_mm), ("width", medians.width_mm)] if medians else []
    return [*_break_up_rows(liquid), *([f"ligaments, median {name} [mm]", *cells_of(one)] for name, one in sizes)]


def _break_up_rows(liquid: ReportedLiquid) -> list[list[str]]:
    found = break_up_of(liquid.reaches)
    if found.value_mm is None or found.low_mm is None:
        return []
    high = "beyond the field" if found.high_mm is None else f"{found.high_mm:.2f}"
    return [["break-up length [mm]", f"{found.value_mm:.2f}", f"{found.low_mm:.2f} to {high}"]]


def _break_up_text(found: BreakUp, true_mm: FloatArray | None = None) -> str:
    """The break-up length in a sentence or two."""
    truth = "" if true_mm is None else f" In truth it is {np.median(true_mm):.2f} mm, the median of the shots."
    if found.value_mm is None or found.low_mm is None:
        return f"No break-up length: {found.reason}.{truth}"
    high = "beyond the field" if found.high_mm is None else f"{found.high_mm:.2f} mm"
    return (
        f"Break-up length {found.value_mm:.2f} mm along the axis (95 % limits {found.low_mm:.2f} mm to {high}; "
        f"{counted(found.shots, 'shot')}).{truth}{_sentence(found.reason)}"
    )


def _sentence(reason: str | None) -> str:
    """What is to be said beside a value, if anything is."""
    return f" {reason[0].upper()}{reason[1:]}{'' if reason.endswith('?') else '.'}" if reason else ""


def _curve(liquid: ReportedLiquid, found: BreakUp) -> BreakUpCurve | None:
    if not found.shots:
        return None
    longest_mm = max(*(max(reach.reach_mm, default=0.0) for reach in liquid.reaches), found.high_mm or 0.0, 0.1)
    distances_mm = np.linspace(0, BEYOND * longest_mm, CURVE_POINTS)
    return BreakUpCurve(connected_share(liquid.reaches, distances_mm), liquid.true_mm)


def _objects_table(liquid: ReportedLiquid) -> Table:
    rows = [_row(kind, liquid) for kind in ObjectClass if kind is not ObjectClass.DROPLET]
    head = ["", "number", "per exposure", "length, median [mm]", "10 to 90 % [mm]", "width, median [mm]"]
    caption = f"Liquid that is no droplet, in {counted(liquid.exposures, 'exposure')}; medians with 95 % intervals"
    return Table(head, rows, caption=caption)


def _row(kind: ObjectClass, liquid: ReportedLiquid) -> list[str]:
    chosen = LiquidObjects.joined([one.where(one.classes == kind) for one in liquid.by_shot])
    numbers = [f"{kind}s", f"{len(chosen)}", f"{len(chosen) / liquid.exposures:.1f}"]
    if not len(chosen):
        return [*numbers, "", "", ""]
    medians = liquid.medians(kind)
    if medians is None:
        return [*numbers, f"{np.median(chosen.lengths_mm):.2f}", "", f"{np.median(chosen.widths_mm):.3f}"]
    low_mm, high_mm = np.percentile(chosen.lengths_mm, (10, 90))
    length, width = ("{} ({})".format(*cells_of(one)) for one in (medians.length_mm, medians.width_mm))
    return [*numbers, length, f"{low_mm:.2f} to {high_mm:.2f}", width]


def unknown_section(shots: Sequence[StoredDroplets]) -> Section | None:
    """Which share of the volume too few views see, and where.

    None where nobody looked for liquid that hides: bright particles, and files of older programs.
    """
    told = [one for shot in shots for one in told_of_exposures(shot)]
    if not told:
        return None
    rows = [row for row in _unknown_rows(shots) if row]
    table = Table(["share of the volume", "mean [%]", "most [%]"], rows, caption="Mean and largest of the exposures")
    maps = [one["unseen"] for one in told if "unseen" in one]
    if len(maps) < len(told) or len({(*one["x_mm"], *one["y_mm"]) for one in maps}) != 1:
        return Section("Where nothing can be known", f"{BLACK_TEXT} {NO_MAP}", [table])
    exposures = counted(len(maps), "exposure")
    caption = f"Seen along z: how much of each line of sight fewer than three views see, mean of {exposures}."
    picture = Picture(unseen_figure(UnseenMap.mean_of(maps)), caption)
    return Section("Where nothing can be known", BLACK_TEXT, [table], [picture])


def _unknown_rows(shots: Sequence[StoredDroplets]) -> list[list[str]]:
    told = [one for shot in shots for one in told_of_exposures(shot)]
    exposures = [one for shot in shots for one in shot.exposures.values()]
    hidden = [one["hidden"]["volume_share"] for one in exposures if one.get("hidden")]
    return [
        _shares("seen by fewer than three views, of what all have in common", [one["unjudged_share"] for one in told]),
        _shares("seen by none, of the same", [one["blind_share"] for one in told]),
        _shares("hidden behind liquid that is masked, of the box in which droplets were measured", hidden),
    ]


def _shares(name: str, shares: Sequence[float]) -> list[str]:
    return [name, f"{100 * np.mean(shares):.2f}", f"{100 * max(shares):.2f}"] if shares else []
