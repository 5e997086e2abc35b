"""What handlers take: the context of the application, and identifiers that are safe as names of files."""

from typing import Annotated

from fastapi import Depends, Path, Request
from fastapi.exceptions import RequestValidationError
from fastapi.routing import APIRoute
from starlette.requests import HTTPConnection

from server.lab.services import Context

_NAME = r"^[A-Za-z0-9][A-Za-z0-9 ._-]{0,127}$"


def context_of(connection: HTTPConnection) -> Context:
    """Return what the application built at start-up."""
    context: Context = connection.app.state.context
    return context


def forbid_unknown_query(request: Request) -> None:
    """Refuse a misspelt query parameter instead of ignoring it."""
    route = request.scope["route"]
    assert isinstance(route, APIRoute)  # noqa: S101 - only routes of this API have this dependency
    known = {field.alias for field in route.dependant.query_params}
    if unknown := sorted(set(request.query_params) - known):
        raise RequestValidationError(
            [
                {"loc": ("query", name), "msg": "there is no such parameter", "type": "extra_forbidden"}
                for name in unknown
            ]
        )


ContextOf = Annotated[Context, Depends(context_of)]
RunId = Annotated[str, Path(pattern=_NAME, description="name of the run directory")]
CalibrationId = Annotated[str, Path(pattern=_NAME)]
JobId = Annotated[str, Path(pattern=r"^[A-Za-z0-9][A-Za-z0-9 ._-]{0,400}$")]
ShotIndex = Annotated[int, Path(ge=0, description="position in the run, from 0")]
