"""What every study hands over beside its figure: its rows as a table, and the paper's statement beside ours."""

import csv
import io
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Protocol, TypeVar


class NamedCase(Protocol):
    """What a study simulates."""

    @property
    def name(self) -> str:
        """For tables and figures."""


class CaseRow(Protocol):
    """What became of a shot of a case."""

    @property
    def case(self) -> str:
        """Its name."""


class FoundRow(Protocol):
    """How many droplets of a shot are found, and how many of what is found are ghosts."""

    @property
    def found(self) -> float:
        """Share of the true ones."""

    @property
    def ghosts(self) -> float:
        """Share of what is told."""


Case = TypeVar("Case", bound=NamedCase)
OfCase = TypeVar("OfCase", bound=CaseRow)
Row = TypeVar("Row")
Key = TypeVar("Key")


@dataclass(frozen=True)
class Statement:
    """A statement of the paper, and what this study found.

    Parameters
    ----------
    topic, paper, ours : str
        What it is about; both sides in words and numbers.
    """

    topic: str
    paper: str
    ours: str

    def __str__(self) -> str:
        return f"{self.topic}: paper: {self.paper}; here: {self.ours}"


def grouped(rows: Iterable[Row], key: Callable[[Row], Key]) -> dict[Key, list[Row]]:
    """Rows by a key, in the order in which they came."""
    groups: dict[Key, list[Row]] = {}
    for row in rows:
        groups.setdefault(key(row), []).append(row)
    return groups


def asked_case(case: Case, asked_for: Iterable[Case]) -> Case:
    """A case; with what is asked for, if it is one of those for which something is."""
    return next((known for known in asked_for if known.name == case.name), case)


def by_case(cases: Iterable[Case], rows: Iterable[OfCase]) -> list[tuple[Case, list[OfCase]]]:
    """Every case that was tried, with its rows."""
    groups = grouped(rows, lambda row: row.case)
    return [(case, groups[case.name]) for case in cases if case.name in groups]


def case_statements(
    tried: Iterable[tuple[Case, Sequence[OfCase]]],
    topic: Callable[[Sequence[OfCase]], str],
    asked: Callable[[Case], str],
    told: Callable[[Sequence[OfCase]], str],
) -> list[Statement]:
    """A statement of every case: its name and topic, what is asked for of it, and what its rows say."""
    return [Statement(f"{case.name}{topic(rows)}", asked(case), told(rows)) for case, rows in tried]


def all_kept(
    cases: Iterable[Case], rows: Iterable[OfCase], kept: Callable[[Case, Sequence[OfCase]], bool | None]
) -> bool | None:
    """Whether every case that was tried keeps what is asked for; None where nothing is."""
    judged = [kept(case, its) for case, its in by_case(cases, rows)]
    asked = [one for one in judged if one is not None]
    return all(asked) if asked else None


def shares_asked(least_found: float | None, most_ghosts: float | None) -> str:
    """What the paper says of droplets found and ghosts, and what is asked for here."""
    if least_found is None or most_ghosts is None:
        return "left open"
    return f"left open, here asked for {100 * least_found:.1f}/{100 * most_ghosts:.1f}"


def shares_told(rows: Sequence[FoundRow]) -> str:
    """Found and ghosts in percent, mean and worst shot."""
    found, ghosts = [100 * row.found for row in rows], [100 * row.ghosts for row in rows]
    means = f"{sum(found) / len(found):.2f}/{sum(ghosts) / len(ghosts):.2f}"
    return f"{means}, worst {min(found):.2f}/{max(ghosts):.2f}"


def csv_text(rows: Sequence[Any]) -> str:
    """Rows, dataclasses of one type, as CSV text with a header line."""
    records = [asdict(row) for row in rows]
    text = io.StringIO()
    writer = csv.DictWriter(text, list(records[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(records)
    return text.getvalue()
