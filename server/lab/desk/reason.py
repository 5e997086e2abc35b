"""Reason: one thing that speaks against a start, for people and programs."""

from typing import Annotated, Literal

from pydantic import Field

from daq.errors import DaqError
from daq.frozen_model import FrozenModel
from daq.run.refusals import REMEDIES, RefusalCode
from server.lab.errors import ServerError

Refusal = DaqError | ServerError
"""An error with a ``code``."""


DeskCode = Literal["control_held", "viewer", "form", "unseen"]
"""Somebody else holds control, who asks may only look, the form on the page is no plan, nobody has looked yet."""


class Reason(FrozenModel):
    """One thing that speaks against a start."""

    code: Annotated[RefusalCode | DeskCode, Field(description="for programs; a start is refused with the same one")]
    text: Annotated[str, Field(description="names device, value and limit")]
    remedy: Annotated[str, Field(description="what to do about it")]


UNSEEN = Reason(
    code="unseen",
    text="the rig is being looked at",
    remedy="wait a second; if it stays, a device or the disk does not answer: its lamp says which",
)
"""Nobody knows what speaks against a start: a run or a live view has just ended, or a look takes long."""


def reason_of(refusal: Refusal) -> Reason:
    """What a refusal says."""
    code = RefusalCode(refusal.code)
    return Reason(code=code, text=str(refusal), remedy=REMEDIES[code])


def refusal_text(error: Exception) -> str:
    """What an operator reads of a refusal: its text, and what to do about it where that is known."""
    remedy = next((REMEDIES[code] for code in RefusalCode if code == getattr(error, "code", "")), "")
    return f"{error} ({remedy})" if remedy else str(error)
