"""A study as a command: it writes CSV and figure, and says what it found."""

import time
from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from server.cli.options import Verbs, add_out, add_verb, count, positive, seed
from server.cli.output import Outcome, heed, progress

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from processing.studies.report import NamedCase, Statement

ENDINGS = (".csv", ".png", "-profiles.csv", "-classes.csv")  # of the files that studies write
Row = TypeVar("Row")
Case = TypeVar("Case", bound="NamedCase")
Study = Callable[[Namespace], dict[str, Any]]


def add_study(studies: Verbs, name: str, study: Study, summary: str) -> ArgumentParser:
    """Add a study by its name."""
    parser = add_verb(studies, name, partial(_run, name, study), summary)
    out = Path(f"study-{name}")
    add_out(parser, f"directory of CSV and figure; default {out}", default=out)
    return parser


def add_linked(studies: Verbs, name: str, study: Study, summary: str, each: str, first_seed: int) -> None:
    """Add a study of droplets that fly; without a density it tries all cases for which something is asked for."""
    parser = add_study(studies, name, study, summary)
    add_repeats(parser, each, 5, first_seed)
    parser.add_argument("--droplets", choices=("bright", "opaque"), help="bright particles, or droplets in shadows")
    parser.add_argument("--density", type=positive, help="droplets per mm^3")


def linked_cases(options: Namespace, kind: Callable[..., Case], asked_for: tuple[Case, ...]) -> tuple[Case, ...]:
    """The case that is stated, or all for which something is asked for."""
    from processing.studies.report import asked_case

    stated = {"droplets": options.droplets, "density_per_mm3": options.density}
    stated = {name: value for name, value in stated.items() if value is not None}
    return (asked_case(kind(**stated), asked_for),) if stated else asked_for


def add_repeats(parser: ArgumentParser, each: str, repeats: int, first_seed: int = 301) -> None:
    """Add the options that ``seeds_of`` asks."""
    parser.add_argument("--seed", type=seed, default=first_seed, help=f"of the first {each} of a case")
    parser.add_argument("--repeats", type=count, default=repeats, help="how many of a case")


def seeds_of(options: Namespace) -> tuple[int, ...]:
    """One for each repeat."""
    return tuple(range(options.seed, options.seed + options.repeats))


def _run(name: str, study: Study, options: Namespace) -> Outcome:
    """Say how long a study took; complain of what cannot be written, or is there already, before and not after."""
    from processing.runs.overwriting import require_free

    options.out.mkdir(parents=True, exist_ok=True)
    require_free(*(options.out / f"{name}{ending}" for ending in ENDINGS), overwrite=options.overwrite)
    wall_s, cpu_s = time.perf_counter(), time.process_time()
    result = study(options)
    seconds = {"wall": time.perf_counter() - wall_s, "cpu": time.process_time() - cpu_s}
    progress(f"took {seconds['wall']:.0f} s, {seconds['cpu']:.0f} CPU-s")
    return Outcome({**result, "seconds": seconds}, _summary(result))


def _summary(result: dict[str, Any]) -> str:
    from processing.studies.report import Statement

    statements = [str(Statement(**statement)) for statement in result["statements"]]
    return "\n".join([*statements, f"{len(result['rows'])} rows in {result['csv']}, {result['figure']}"])


def collected(rows: Iterable[Row], line: Callable[[Row], str]) -> list[Row]:
    """All rows; each is told when it comes."""
    collected = []
    for row in rows:
        heed()
        progress(line(row))
        collected.append(row)
    return collected


def passing(result: dict[str, Any], passed: bool | None, what: str) -> dict[str, Any]:
    """The JSON object of a study with whether it passed, which is told; None where nothing is asked for."""
    if passed is None:
        progress("nothing is asked for of this case")
        return result
    progress(f"{what}: {'PASSED' if passed else 'FAILED'}")
    return {**result, "passed": passed}


def report(
    out: Path, name: str, rows: Sequence[Any], figure: "Figure", statements: "Sequence[Statement]"
) -> dict[str, Any]:
    """Write CSV and figure; the JSON object of the study."""
    from processing.runs.overwriting import replacing
    from processing.studies.report import csv_text

    csv, picture = out / f"{name}.csv", out / f"{name}.png"
    with replacing(csv) as part:
        part.write_text(csv_text(rows), encoding="utf-8")
        figure.savefig(part.with_name(picture.name), dpi=150)
    return {
        "csv": str(csv),
        "figure": str(picture),
        "rows": [asdict(row) for row in rows],
        "statements": [asdict(statement) for statement in statements],
    }
