# ruff: noqa: T201
"""Hunts for lies: sprays that are known, distorted by chance, measured by the product, and judged.

    python -m tests.hunt [--minutes 10] [--seed 1] [--cases N] [--world KIND] [--distortions NAME+NAME] [--amount 0.5]

Prints a line per case, and at the end, or when a signal ends it, a table of what became of them; ``--json FILE`` keeps
a line of JSON of each. The same seed is the same case. Exit status 1 if anything that is told as good is a lie.
"""

import json
import sys
import time
from argparse import ArgumentParser, Namespace
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import asdict
from itertools import count, islice
from pathlib import Path

from server.cli.output import endable
from tests.hunt.case import Case, drawn_case
from tests.hunt.distortions import DISTORTIONS
from tests.hunt.world import KINDS

OUTCOMES = ("lie", "named", "right", "doubted", "refused", "alarm")


def main(arguments: list[str]) -> int:
    """Hunt, tell; the exit status."""
    options = _options(arguments)
    cases = []
    with suppress(KeyboardInterrupt), endable():
        for case in _hunted(options):
            cases.append(case)
            print(line(case), flush=True)
            if options.json:
                with options.json.open("a") as file:
                    file.write(json.dumps(asdict(case)) + "\n")
    print("\n".join(["", *table(cases)]))
    return int(any(case.outcome == "lie" for case in cases))


def _options(arguments: list[str]) -> Namespace:
    parser = ArgumentParser(prog="python -m tests.hunt")
    parser.add_argument("--minutes", type=float, default=10)
    parser.add_argument("--seed", type=int, default=1, help="of the first case")
    parser.add_argument("--cases", type=int, help="default: as many as there is time for")
    parser.add_argument("--world", choices=KINDS, default="", help="default: drawn")
    parser.add_argument("--distortions", help=f"drawn; none, or one or two with +: {', '.join(DISTORTIONS)}")
    parser.add_argument("--amount", type=float, help="of the distortions, 0 to 1; default: drawn")
    parser.add_argument("--json", type=Path, help="file to which a line per case is added")
    return parser.parse_args(arguments)


def _hunted(options: Namespace) -> Iterator[Case]:
    names = None if options.distortions is None else [one for one in options.distortions.split("+") if one != "none"]
    end_s = time.monotonic() + 60 * options.minutes
    for seed in islice(count(options.seed), options.cases):
        if time.monotonic() > end_s:
            return
        yield drawn_case(seed, options.world, names, options.amount)


def line(case: Case) -> str:
    """What was done, and what came of it."""
    done = " + ".join(f"{name} {amount}" for name, amount in case.distortions) or "undistorted"
    wrong = "; ".join(
        f"{one.number} {one.told:.4g} for {one.true:.4g} ({100 * one.error:+.1f} %, allowed {one.allowed:.2g})"
        for one in case.verdict.wrong[:3]
    )
    doubt = case.verdict.doubts[0][:120] if case.verdict.doubts else ""
    return f"{case.outcome:8}seed {case.seed}  {case.world}  {done}  {wrong or doubt}"


def table(cases: list[Case]) -> list[str]:
    """Counts by distortion, lies first, and rates."""
    rows: dict[str, Counter[str]] = {}
    for case in cases:
        for name in [name for name, _ in case.distortions] or ["undistorted"]:
            rows.setdefault(name, Counter())[case.outcome] += 1
    ordered = sorted(rows.items(), key=lambda row: (-row[1]["lie"], -row[1]["alarm"], row[0]))
    head = f"{'distortion':24}" + "".join(f"{outcome:>9}" for outcome in OUTCOMES)
    body = [f"{name:24}" + "".join(f"{told[outcome] or '':>9}" for outcome in OUTCOMES) for name, told in ordered]
    return [head, *body, "", rates(cases)]


def rates(cases: list[Case]) -> str:
    """Lies of what is distorted, alarms of what is not, and right answers of all."""
    plain = [case for case in cases if not case.distortions]
    told = Counter(case.outcome for case in cases)
    return (
        f"{len(cases)} cases: {told['lie']} lies, {told['named']} named in not_checked, {told['right']} right; "
        f"{told['alarm']} alarms in {len(plain)} undistorted worlds"
    )


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
