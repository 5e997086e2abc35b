"""Checkup: one thing that ``tomoshadow doctor`` has looked at, what it found, and how to mend it."""

from dataclasses import dataclass
from enum import StrEnum


class Status(StrEnum):
    """How bad it is."""

    OK = "ok"
    WARN = "warn"
    """It works, slower or less surely than it could."""
    FAIL = "fail"
    """Runs, calibrations or reconstructions will not work."""


@dataclass(frozen=True)
class Checkup:
    """One finding.

    Parameters
    ----------
    name : str
        What was looked at.
    status : Status
        How bad it is.
    detail : str
        What was found, with values and limits.
    remedy : str
        How to mend it; empty where nothing needs to be mended.
    """

    name: str
    status: Status
    detail: str
    remedy: str = ""

    def __str__(self) -> str:
        return f"{self.status:4}  {self.name}: {self.detail}" + (f"\n      -> {self.remedy}" if self.remedy else "")
