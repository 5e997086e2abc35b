"""Where a key stands in a TOML text: ``tomllib`` does not tell, and an error message should."""

import re
from collections import Counter
from collections.abc import Iterator, Sequence

Key = tuple[str | int, ...]

_HEADER = re.compile(r"^\s*(\[\[?)\s*([^\[\]]+?)\s*\]\]?\s*(?:#.*)?$")
_ASSIGNMENT = re.compile(r"^\s*([A-Za-z0-9_.\"'-]+)\s*=")


def line_of(text: str, key: Sequence[str | int]) -> int | None:
    """Line, counted from 1, of a key or of the nearest table around it; None where nothing of it is there.

    Parameters
    ----------
    text : str
        A TOML document.
    key : sequence of str or int
        Path of the key; numbers count the elements of an array of tables from 0.
    """
    best_line, best_length = None, 0
    for found, line in _keys(text):
        if len(found) > best_length and tuple(key[: len(found)]) == found:
            best_line, best_length = line, len(found)
    return best_line


def _keys(text: str) -> Iterator[tuple[Key, int]]:
    table: Key = ()
    elements: Counter[Key] = Counter()
    for line, content in enumerate(text.splitlines(), start=1):
        if header := _HEADER.match(content):
            table = _parts(header[2])
            if header[1] == "[[":
                elements[table] += 1
                table = (*table, elements[table] - 1)
            yield table, line
        elif assignment := _ASSIGNMENT.match(content):
            yield (*table, *_parts(assignment[1])), line


def _parts(dotted: str) -> Key:
    return tuple(part.strip(" \"'") for part in dotted.split("."))
