"""Names of many image files as one text: ``day7/{view}/im{shot:04d}_a.tif``."""

import glob
import re
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from string import Formatter

_FIELDS = {"view": r"[A-Za-z0-9][A-Za-z0-9_.-]*", "shot": r"\d+"}
_NUMBER = re.compile(r"(0[1-9]\d?)?d?")


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

    def found(self, root: Path) -> dict[str, list[int]]:
        """Views that have files below a folder, in the order of their names, with the numbers of their shots."""
        numbers: dict[str, set[int]] = {}
        for name in glob.iglob(self._wildcards, root_dir=root):
            match = self._expression.fullmatch(name)
            shot = int(match["shot"]) if match and self.counts_shots else 0
            if match and self.file(match["view"], shot) == name:
                numbers.setdefault(match["view"], set()).add(shot)
        return {view: sorted(numbers[view]) for view in sorted(numbers)}

    @cached_property
    def _parts(self) -> list[tuple[str, str | None, str | None, str | None]]:
        return list(Formatter().parse(self.text))

    @cached_property
    def _wildcards(self) -> str:
        return "".join(glob.escape(literal) + ("*" if name else "") for literal, name, _, _ in self._parts)

    @cached_property
    def _expression(self) -> re.Pattern[str]:
        """With groups ``view`` and ``shot``; that a field which comes again says the same is for the caller to see."""
        text, named = "", set()
        for literal, name, _, _ in self._parts:
            text += re.escape(literal)
            if name:
                text += f"(?:{_FIELDS[name]})" if name in named else f"(?P<{name}>{_FIELDS[name]})"
                named.add(name)
        return re.compile(text)
