"""What every study hands over beside its figure: its rows as a table, and the paper's statement beside ours."""

import csv
import io
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any, TypeVar

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


def csv_text(rows: Sequence[Any]) -> str:
    """Rows, dataclasses of one type, as CSV text with a header line."""
    records = [asdict(row) for row in rows]
    text = io.StringIO()
    writer = csv.DictWriter(text, list(records[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(records)
    return text.getvalue()
