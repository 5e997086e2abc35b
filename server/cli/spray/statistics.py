"""``tomoshadow statistics``: what the droplets of many shots say of the spray as a whole."""

from argparse import Namespace
from typing import TYPE_CHECKING, Any

from daq.counted import counted
from server.cli.options import Verbs, add_verb
from server.cli.output import Outcome, table
from server.cli.spray.spray_options import add_sprays, asked_for

if TYPE_CHECKING:
    from processing.analysis.spray.comparison import Difference
    from processing.analysis.spray.spray_statistics import SprayStatistics
    from processing.runs.sprays.measured_spray import MeasuredSpray

NAME = "statistics"


def add(verbs: Verbs) -> None:
    """Add the command."""
    parser = add_verb(
        verbs, NAME, statistics, "diameters, flux, patternation of a spray, from droplets that are measured"
    )
    add_sprays(parser)
    parser.add_argument(
        "--compare", action="store_true", help="each directory is a spray: what differs, and how surely"
    )


def statistics(options: Namespace) -> Outcome:
    """Pool the shots of all results, or compare them."""
    from processing.runs.liquid.objects import liquid_summary
    from processing.runs.sprays.measured_spray import read_spray

    if options.compare:
        return _compare(options)
    spray = read_spray(options.results)
    told, liquid = _told(options, spray), liquid_summary(spray.shots).model_dump(mode="json")
    changes = list(spray.changes)
    result = {"results": spray.name, "conditions_changed": changes, "liquid": liquid, **told.model_dump(mode="json")}
    return Outcome(result, _text(spray, told))


def _told(options: Namespace, spray: "MeasuredSpray") -> "SprayStatistics":
    from processing.runs.sprays.measured_spray import told_spray

    return told_spray(spray, asked_for(options, spray))


def _compare(options: Namespace) -> Outcome:
    from processing.analysis.spray.comparison import NOTHING, differences, not_compared
    from processing.runs.sprays.measured_spray import read_compared

    sprays = read_compared(options.results)
    told = {name: _told(options, spray) for name, spray in sprays.sprays.items()}
    found, alone = differences(told), not_compared(told)
    result = {
        "runs": {name: one.model_dump(mode="json") for name, one in told.items()},
        "conditions_differ": list(sprays.conditions),
        "measured_differently": list(sprays.unlike),
        "conditions_changed": [change for spray in sprays.sprays.values() for change in spray.changes],
        "not_compared": list(alone),
        "differences": [one.model_dump(mode="json") for one in found],
        "reason": None if found else NOTHING,
    }
    differing = [*sprays.conditions, *(f"measured differently: {one}" for one in sprays.unlike)]
    unchecked = dict.fromkeys(one.text for its in told.values() for one in its.not_checked)
    of_each = [_text(spray, told[name].model_copy(update={"not_checked": ()})) for name, spray in sprays.sprays.items()]
    texts = [*of_each, *differing, *alone, "\n".join(unchecked)]
    return Outcome(result, "\n\n".join([*texts, _differences(found) if found else NOTHING]))


def _text(spray: "MeasuredSpray", told: "SprayStatistics") -> str:
    from server.reports.spray_tables import doubts, figure_rows, twice

    seen = f"{counted(told.droplets.n, 'droplet')}, shots: {told.droplets.shots}, exposures: {told.droplets.exposures}"
    seen += twice(told)
    sample = f"; sample: {told.sample.verdict}" if told.sample else ""
    head = f"{spray.name}: {seen}; sampling: {told.sampling}{sample}"
    figures = [table(["", "", "95 %"], rows)] if (rows := figure_rows(told)) else []
    return "\n".join([head, *figures, *doubts(told), *spray.changes])


def _differences(found: "tuple[Difference, ...]") -> str:
    from server.reports.spray_tables import LABELS

    rows: list[list[Any]] = [
        [
            f"{one.second} / {one.first}",
            LABELS[one.figure],
            f"{one.ratio.value:.3f} ({one.ratio.low:.3f} to {one.ratio.high:.3f})",
            f"{one.p_corrected:.2g}",
            "differs" if one.significant else "",
        ]
        for one in found
    ]
    said = "p is corrected for all of these figures and pairs (Holm): below 0.05 a figure differs"
    none = "" if any(one.significant for one in found) else "; none does beyond chance"
    return f"{table(['runs', 'figure', 'ratio, 95 %', 'p', ''], rows)}\n{said}{none}"
