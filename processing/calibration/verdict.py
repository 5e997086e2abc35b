"""Verdict: what a view is good for, what speaks against it, and what nothing told."""

import re
from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated

from pydantic import ConfigDict, Field, with_config

BELONGING = "belonging"
"""Under this name results keep what droplets say of their run and calibration."""


class Verdict(StrEnum):
    """What a view is good for, by its hold-out error."""

    GOOD = "good"
    USABLE = "usable"
    WARN = "warn"
    REFUSE = "refuse"


def worse(one: Verdict, other: Verdict) -> Verdict:
    """The less favourable of two verdicts."""
    return max(one, other, key=list(Verdict).index)


@dataclass(frozen=True)
class Doubt:
    """What speaks against views although each of them fits its own points well.

    Parameters
    ----------
    views : tuple[str, ...]
        Whom it concerns.
    text : str
        What does not agree, by value and limit, and what to ask oneself.
    verdict : Verdict
        The best that these views deserve.
    """

    views: tuple[str, ...]
    text: str
    verdict: Verdict = Verdict.WARN


_SHOT = "shot {} of run {}: "


def doubt_of_shot(views: tuple[str, ...], shot: int, run: str, problem: str, verdict: Verdict) -> Doubt:
    """What the droplets of a shot say against views."""
    return Doubt(views, f"{_SHOT.format(shot, run)}{problem}", verdict)


def is_of_shot(reason: str) -> bool:
    """Whether droplets have said so: a view that they have corrected since is another one."""
    return re.match(re.escape(_SHOT).replace(r"\{\}", r"\S+"), reason) is not None


@with_config(ConfigDict(extra="forbid", allow_inf_nan=False))
@dataclass(frozen=True)
class Unchecked:
    """What nothing told, and what would tell it.

    Parameters
    ----------
    what : str
        What may be wrong without showing.
    state : str
        What to state so that it is checked.
    """

    what: Annotated[str, Field(description="what may be wrong without showing")]
    state: Annotated[str, Field(description="what to state so that it is checked")]

    @property
    def text(self) -> str:
        """A line for a person."""
        return f"not checked: {self.what}; state {self.state}"
