"""LightRequest: what every request that makes light says of itself, so that it makes light once, and now or never."""

from collections.abc import Callable
from typing import Annotated, TypeVar

from pydantic import Field

from daq.frozen_model import FrozenModel
from server.lab.desk.visitor import Visitor, unnamed_script
from server.lab.services import Context
from server.lab.starting.command import command

Answer = TypeVar("Answer")


class LightRequest(FrozenModel):
    """Who asks, and when."""

    key: Annotated[str | None, Field(description="the same request has the same key; null: it is no repetition")] = None
    beat: Annotated[int | None, Field(description="the last beat that was heard; null: a script, which hears none")] = (
        None
    )
    who: Annotated[Visitor, Field(description="holds control from now on")] = unnamed_script("this computer")


def obey(context: Context, request: LightRequest, what: str, action: Callable[[], Answer]) -> Answer:
    """Do what makes light, if he who asks holds control, for the first time, and was not too long on his way.

    Raises
    ------
    Stale
        The last beat that was heard is more than two seconds old.
    Conflict, Unprocessable
        The key is that of a request under way, or of another one.
    Forbidden, Locked
        A viewer asks, or somebody else holds control.
    """

    def act() -> Answer:
        if request.beat is not None:
            context.beat.require_fresh(request.beat)
        return command(context, request.who, _deed(what), action)

    return context.once.do(request.key, what, act)


def _deed(what: str) -> str:
    """What was asked for, in a word or two."""
    return f"started {what.partition(' ')[0] if '{' in what else what}"
