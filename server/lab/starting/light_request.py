"""LightRequest: what every request that makes light says of itself, so that it makes light once, and now or never."""

from collections.abc import Callable
from typing import Annotated, TypeVar

from pydantic import Field

from daq.frozen_model import FrozenModel
from server.lab.services import Context

Answer = TypeVar("Answer")


class LightRequest(FrozenModel):
    """Who asks, and when."""

    key: Annotated[str | None, Field(description="the same request has the same key; null: it is no repetition")] = None
    beat: Annotated[int | None, Field(description="the last beat that was heard; null: a script, which hears none")] = (
        None
    )


def obey(context: Context, request: LightRequest, what: str, action: Callable[[], Answer]) -> Answer:
    """Do what makes light, if that is asked for the first time and was not too long on its way.

    Raises
    ------
    Stale
        The last beat that was heard is more than two seconds old.
    Conflict, Unprocessable
        The key is that of a request under way, or of another one.
    """

    def act() -> Answer:
        if request.beat is not None:
            context.beat.require_fresh(request.beat)
        return action()

    return context.once.do(request.key, what, act)
