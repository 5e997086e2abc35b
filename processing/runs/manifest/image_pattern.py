"""Names of many image files as one text: ``day7/{view}/im{shot:04d}_a.tif``."""

import glob
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from string import Formatter

_FIELDS = {"view": r"[A-Za-z0-9][A-Za-z0-9_.-]*", "shot": r"\d+"}
_NUMBER = re.compile(r"(0[1-9]\d?)?d?")
_ANY = "(?i:{})"
"""Capital letters or not."""
_REMEDY = "pad {shot}, and write capital letters, as files are"


@dataclass(frozen=True)
class ImagePattern:
    """A file name with ``{view}`` and, unless the pages of one file are the shots, ``{shot}`` in it.

    Parameters
    ----------
    text : str
        As a manifest has it; ``{shot:04d}`` fills up with zeros.

    Raises
    ------
    ValueError
        It lacks ``{view}``, has other fields, or a shot is to be written otherwise than as a number.
    """

    text: str

    def __post_init__(self) -> None:
        if not self.text.isprintable():
            raise ValueError(f"{self.text!r}: a file name has no control characters")
        for _, name, written, conversion in self._parts:
            if name is not None and name not in _FIELDS:
                raise ValueError(f"{self.text}: {{{name}}} is neither {{view}} nor {{shot}}")
            if conversion or not _NUMBER.fullmatch(written or "") or (name == "view" and written):
                raise ValueError(f"{self.text}: {{{name}:{written}}}: only numbers are padded, as {{shot:04d}}")
        if all(name != "view" for _, name, _, _ in self._parts):
            raise ValueError(f"{self.text}: {{view}} must say where the name of the camera stands")

    @property
    def counts_shots(self) -> bool:
        """Whether every shot has a file of its own; else the pages of one file are the shots."""
        return any(name == "shot" for _, name, _, _ in self._parts)

    def file(self, view: str, shot: int) -> str:
        """Name of the file of one shot."""
        return self.text.format(view=view, shot=shot)

    def found(self, root: Path, views: Sequence[str] | None = None) -> dict[str, list[int]]:
        """Views that have files below a folder, in the order of their names, with the numbers of their shots.

        Parameters
        ----------
        root : Path
            The folder.
        views : sequence of str, optional
            Which ones; by default all names that there are.

        Raises
        ------
        ValueError
            A file has its number padded otherwise than the pattern, or other capital letters; or it is not clear where
            a name ends.
        """
        if views is None and self._touching:
            raise ValueError(f"{self.text}: {{view}} and {{shot}} touch, so name the cameras: views = [...]")
        names = sorted(glob.iglob(self._wildcards, root_dir=root))
        found = {view: sorted(self._numbers(names, view)) for view in views or sorted(self._views(names))}
        return {view: found[view] for view in sorted(found) if found[view]}

    def _views(self, names: Sequence[str]) -> set[str]:
        expression = self._expression(capitals=_ANY)
        return {match["view"] for name in names if (match := expression.fullmatch(name))}

    def _numbers(self, names: Sequence[str], view: str) -> set[int]:
        """Of the shots of a view."""
        numbers, expression = set[int](), self._expression(view, capitals=_ANY)
        for match in filter(None, map(expression.fullmatch, names)):
            written = {int(text) for name, text in match.groupdict().items() if name != "view"}
            if len(written) > 1:  # a number that comes twice says two things
                continue
            shot = min(written, default=0)
            if (called := self.file(view, shot)) != match[0]:
                raise ValueError(f"{match[0]} is there, and is {called} by {self.text}: {_REMEDY}")
            numbers.add(shot)
        return numbers

    @cached_property
    def _parts(self) -> list[tuple[str, str | None, str | None, str | None]]:
        return list(Formatter().parse(self.text))

    @cached_property
    def _wildcards(self) -> str:
        """Of all that the pattern may mean, whatever letters are capitals."""
        return "".join(_either(literal) + ("*" if name else "") for literal, name, _, _ in self._parts)

    @cached_property
    def _touching(self) -> bool:
        """Whether a name and a number follow one another with nothing between them that could tell them apart."""
        return any(not literal and number > 0 for number, (literal, name, _, _) in enumerate(self._parts) if name)

    def _expression(self, view: str | None = None, capitals: str = "{}") -> re.Pattern[str]:
        """With groups ``view``, which says the same where it comes again, and ``shot0``, ``shot3``, ... for numbers."""
        fields = _FIELDS if view is None else {**_FIELDS, "view": re.escape(view)}
        text, named = "", False
        for number, (literal, name, _, _) in enumerate(self._parts):
            text += capitals.format(re.escape(literal)) if literal else ""
            if name == "view":
                text, named = text + ("(?P=view)" if named else f"(?P<view>{fields[name]})"), True
            elif name:
                text += f"(?P<shot{number}>{fields[name]})"
        return re.compile(text)


def _either(literal: str) -> str:
    """For ``glob``: the same text, each letter large or small."""
    letters = (
        f"[{one.lower()}{one.upper()}]" if one.isascii() and one.isalpha() else glob.escape(one) for one in literal
    )
    return "".join(letters)
