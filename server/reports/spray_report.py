"""The report of a spray: where its numbers come from, what they are, how sure, and what cannot be known.

Each chapter is a function of what is reported, in ``CHAPTERS``; one that has nothing to say returns None.
"""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from daq.counted import counted
from processing.analysis.droplets.droplet_file import StoredDroplets
from processing.analysis.spray.density_map import NO_CELLS, density_maps
from processing.analysis.spray.spray_sample import SpraySample, spray_sample
from processing.analysis.spray.spray_statistics import AskedFor, SprayStatistics
from processing.analysis.spray.velocity_field import field_across_axis, field_through_axis
from processing.figures.sprays.distribution_figure import distribution_figure
from processing.figures.sprays.field_figure import velocity_field_figure
from processing.figures.sprays.motion_figure import motion_figure
from processing.figures.sprays.space_figures import density_figure, patternation_figure
from processing.runs.sprays.measured_spray import MeasuredSpray, told_spray
from server.reports.liquid_sections import ReportedLiquid, break_up_section, liquid_rows, unknown_section
from server.reports.object_motion_section import object_motion_section
from server.reports.origin_section import notes_of, origin_of
from server.reports.page import Picture, Section, write_report
from server.reports.shots_section import VERDICT, exposure_rows, shots_section
from server.reports.spray_tables import (
    classes_table,
    detection_table,
    doubts,
    figures_table,
    fits_table,
    patternation_table,
    twice,
)

DEFINITIONS = (
    "Sampling is spatial: a flash sees the droplets that are in a volume at an instant (ASTM E799). Flux-weighted "
    "figures take each droplet by its velocity along the axis, as an instrument does that counts what passes an area.",
    "D_pq = (sum d^p / sum d^q)^(1 / (p - q)) (ISO 9276-2). Dv0.1, Dv0.5, Dv0.9: 10, 50, 90 % of the volume is in "
    "smaller droplets; relative span = (Dv0.9 - Dv0.1) / Dv0.5. Classes are geometric, R20 (ISO 9276-1).",
    "Intervals hold 95 %, over shots drawn with replacement, with Student's t; of a single shot over its droplets: "
    "then they do not know how shots differ.",
    "Fits are by maximum likelihood, droplets weighted by volume; they fit where their largest gap is no larger than "
    "chance makes it.",
    "Cone angle: twice the angle from the axis, at the nozzle, within which that share of the liquid of the box is. "
    "Penetration: the distance beyond which 1 % of it is. No threshold is chosen.",
    "Asymmetry: half the sum of |share - 1/n| over the sectors; beside it what 95 % of even sprays stay below.",
)


SAMPLES = {"adequate": "The sample is adequate.", "low sample": "The sample is low: intervals may be too narrow."}
Chapter = Callable[["ReportedSpray"], Section | None]


@dataclass(frozen=True, eq=False)
class ReportedSpray:
    """What a report is about.

    Parameters
    ----------
    spray : MeasuredSpray
        Shots, and where they come from.
    asked : AskedFor
        Nozzle, axis, density of the liquid.
    told : SprayStatistics
        What the droplets say.
    sample : SpraySample | None
        The droplets themselves; None where they have no diameters.
    """

    spray: MeasuredSpray
    asked: AskedFor
    told: SprayStatistics
    sample: SpraySample | None

    @classmethod
    def of(cls, spray: MeasuredSpray, asked: AskedFor) -> "ReportedSpray":
        """Compute what is reported."""
        told = told_spray(spray, asked)
        return cls(spray, asked, told, spray_sample(spray.shots) if told.classes else None)


def write_spray_report(file: Path, reported: ReportedSpray) -> None:
    """Write the page; an existing report is replaced."""
    write_report(file, f"Spray report: {reported.spray.name}", spray_sections(reported, CHAPTERS))


def spray_sections(reported: ReportedSpray, chapters: Sequence[Chapter] = ()) -> list[Section]:
    """Chapters that have something to say; by default those of the spray alone, for another report."""
    said = (chapter(reported) for chapter in chapters or OF_THE_SPRAY)
    return [one for one in said if one]


def _summary(reported: ReportedSpray) -> Section:
    told = reported.told
    seen = (
        f"{counted(told.droplets.n, 'droplet')}, exposures: {told.droplets.exposures}{twice(told)}, "
        f"shots: {told.droplets.shots}; sampling: {told.sampling}."
    )
    text = f"{seen} {SAMPLES[told.sample.verdict] if told.sample else ''} {_verdicts(reported)}"
    liquid = ReportedLiquid.of_files(reported.spray.shots)
    table = figures_table(told, liquid_rows(liquid) if liquid else ())
    return Section("Summary", text, [table], points=[*conditions_of(reported), *doubts(told)])


def conditions_of(reported: ReportedSpray) -> list[str]:
    """What the operator wrote down, in a line; and what of it was changed later."""
    notes = "; ".join(f"{name}: {value}" for name, value in notes_of(reported.spray))
    return [*([f"Conditions: {notes}"] if notes else []), *reported.spray.changes]


def _verdicts(reported: ReportedSpray) -> str:
    """How many exposures are good, doubtful, refused."""
    exposures = Counter(row[VERDICT] for row in exposure_rows(reported.spray.shots))
    return "Verdicts on the exposures: " + ", ".join(f"{n} {verdict}" for verdict, n in exposures.items()) + "."


def origin_section(reported: ReportedSpray) -> Section:
    """Runs, calibration, recipe, programs, and what the operator wrote down."""
    return origin_of(reported.spray, reported.asked.axis, reported.sample)


def _sizes(reported: ReportedSpray) -> Section | None:
    told = reported.told
    if not told.classes:
        return None
    smallest = f"The smallest droplet has {told.smallest_um:.3g} µm." if told.smallest_um else ""
    picture = Picture(
        distribution_figure(told),
        "Left: distribution of diameters over ln d, by number with 95 % intervals of counting, by area and by volume, "
        "and fits to the volume. Right: cumulative, with mean diameters and their 95 % intervals over "
        f"{told.droplets.intervals_over or 'shots'}.",
        svg=True,
    )
    tables = [fits_table(told.fits)] if told.fits else []
    return Section("Sizes", smallest, tables, [picture], told.corrections)


def _motion(reported: ReportedSpray) -> Section | None:
    motion, sample = reported.told.motion, reported.sample
    if motion is None or sample is None:
        return None
    text = (
        f"{100 * motion.paired_share:.1f} % of the droplets have a velocity; of the others the partner was not found, "
        "or is outside of the box in the other exposure. Flux-weighted figures: "
        f"{motion.flux_weighting}. In the flux, droplets without a velocity take the mean one by volume."
    )
    speeds_m_s = np.linalg.norm(sample.velocities_m_s, axis=1)
    caption = (
        "Left: speed against diameter; right: velocities against the distance from the axis, means with 95 % intervals."
    )
    figure = motion_figure(motion, sample.diameters_um, speeds_m_s)
    return Section("Velocities", text, pictures=[Picture(figure, caption, svg=True)])


def _velocity_field(reported: ReportedSpray) -> Section | None:
    sample, axis = reported.sample, reported.asked.axis
    if sample is None or axis is None:
        return None
    through, across = field_through_axis(sample, axis), field_across_axis(sample, axis)
    if through is None and across is None:
        return None
    caption = (
        "Arrows: mean velocities of the droplets of a cell, within the slice. "
        + ("Left: through the axis; colours are numbers of droplets. Right: " if through and across else "A slice ")
        + ("across the axis; colours are velocities along it. " if across else "through it; colours count droplets. ")
        + "Cells with fewer than five droplets that have a velocity have no arrow."
    )
    flat = "" if through else "The box is too flat along the axis for a slice through it."
    return Section(
        "Velocity field", flat, pictures=[Picture(velocity_field_figure(through, across), caption, svg=True)]
    )


def _patternations(reported: ReportedSpray) -> Section | None:
    found = reported.told.patternations
    if not found:
        return None
    pictures = [
        Picture(
            patternation_figure(one),
            f"Patternation {one.at_mm:.3g} mm from the nozzle, a slice of {one.thickness_mm:.3g} mm, "
            f"{counted(one.n, 'droplet')}. Left: liquid by cells as seen from downstream, grey where the box does not "
            f"reach; {one.azimuths[1]} is at 90°. Right: shares of the sectors, 95 % intervals.",
            svg=True,
        )
        for one in found
    ]
    return Section("Patternation", points=[one.reason for one in found if one.reason], pictures=pictures)


def _density(reported: ReportedSpray) -> Section | None:
    if reported.sample is None:
        return None
    maps = density_maps(reported.sample)
    if not maps:
        return None
    caption = "Number density per volume that could be measured, mean along the direction that is not drawn: mean over "
    caption += "all exposures, grey where less than half of a cell could be measured"
    if reported.sample.several:
        caption += "; rms: how shots scatter, beside what chance alone would make (Poisson)"
    known = all(one.measured_share is not None for one in maps)
    pictures = [Picture(density_figure(maps), f"{caption}.", svg=True)]
    return Section("Number density", "" if known else f"Not corrected cell by cell: {NO_CELLS}.", pictures=pictures)


def _break_up(reported: ReportedSpray) -> Section | None:
    liquid = ReportedLiquid.of_files(reported.spray.shots)
    return break_up_section(liquid) if liquid else None


def _of_shots(section: Callable[[Sequence[StoredDroplets]], Section | None]) -> Chapter:
    return lambda reported: section(reported.spray.shots)


def _tables(reported: ReportedSpray) -> Section | None:
    told = reported.told
    tables = [classes_table(told)] if told.classes else []
    tables += [detection_table(told.detection)] if told.detection else []
    tables += [patternation_table(one) for one in told.patternations if one.sector_shares]
    return Section("Tables", tables=tables) if tables else None


def definitions_section(_: ReportedSpray | None = None) -> Section:
    """What sampling, means, classes, intervals and shares are."""
    return Section("What the figures mean", points=DEFINITIONS)


OF_THE_SPRAY: tuple[Chapter, ...] = (_sizes, _motion, _velocity_field, _patternations, _density)
OF_SHOTS: tuple[Chapter, ...] = tuple(map(_of_shots, (object_motion_section, unknown_section, shots_section)))
CHAPTERS: tuple[Chapter, ...] = (
    _summary,
    origin_section,
    *OF_THE_SPRAY,
    _break_up,
    *OF_SHOTS,
    _tables,
    definitions_section,
)
