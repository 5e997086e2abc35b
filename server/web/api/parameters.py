"""What handlers take: the context of the application, and identifiers that are safe as names of files.

All of them are coroutines: FastAPI lets functions wait for a thread.
"""

import json
import re
from contextlib import suppress
from typing import Annotated

from fastapi import Depends, Header, Path, Request
from fastapi.exceptions import RequestValidationError
from fastapi.routing import APIRoute
from starlette.requests import HTTPConnection

from daq.names import Identifier
from server.lab.desk.visitor import Visitor
from server.lab.services import Context
from server.lab.starting.light_request import LightRequest
from server.web.abort_listener import AbortListener
from server.web.door import Door
from server.web.guard import visitor_of

_HALF_CHARACTER = re.compile(rb"\\u[dD][89a-fA-F]")
"""Where a JSON text may have one: it writes a character beyond the first 65,536 as two."""


async def context_of(connection: HTTPConnection) -> Context:
    """Return what the application built at start-up."""
    context: Context = connection.app.state.context
    return context


async def abort_port_of(connection: HTTPConnection) -> int:
    """Return where ABORT alone is listened for."""
    listener: AbortListener = connection.app.state.abort_listener
    return listener.port


async def forbid_unknown_query(request: Request) -> None:
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


async def forbid_half_characters(request: Request) -> None:
    """Refuse a text that JSON can write, and that no file, answer or event can take."""
    route = request.scope["route"]
    if route.body_field is None or not _HALF_CHARACTER.search(await request.body()):
        return  # ABORT waits for no body
    with suppress(ValueError, RecursionError):  # it is refused for that
        _require_whole_characters(await request.json())


def _require_whole_characters(body: object) -> None:
    try:
        json.dumps(body, ensure_ascii=False).encode()
    except UnicodeEncodeError as error:
        problem = f"holds half a character, {error.object[error.start]!a}: write whole ones"
        raise RequestValidationError([{"loc": ("body",), "msg": problem, "type": "string_unicode"}]) from error


async def door_of(connection: HTTPConnection) -> Door:
    """Return what decides who comes in."""
    door: Door = connection.app.state.door
    return door


async def who_of(
    connection: HTTPConnection,
    tomoshadow_operator: Annotated[
        str | None,
        Header(max_length=100, description="a script says who runs it, as ann@lab, and may then hold control"),
    ] = None,
) -> Visitor:
    """Who asks; the guard has found out."""
    del tomoshadow_operator  # declared here, read there
    return visitor_of(connection)


IdempotencyKey = Annotated[
    str | None,
    Header(min_length=1, max_length=200, description="repeated with this key, the request is obeyed once"),
]


async def light_request(
    who: Annotated[Visitor, Depends(who_of)],
    idempotency_key: IdempotencyKey = None,
    tomoshadow_beat: Annotated[
        int | None, Header(ge=0, le=2**53, description="of /api/beat, heard last: more than 2 s later it is refused")
    ] = None,
) -> LightRequest:
    """What a request that makes light says of itself."""
    return LightRequest(key=idempotency_key, beat=tomoshadow_beat, who=who)


AsksForLight = Annotated[LightRequest, Depends(light_request)]
Who = Annotated[Visitor, Depends(who_of)]
DoorOf = Annotated[Door, Depends(door_of)]
AbortPort = Annotated[int, Depends(abort_port_of)]
ContextOf = Annotated[Context, Depends(context_of)]
RunId = Annotated[Identifier, Path(description="name of the run directory")]
CalibrationId = Annotated[Identifier, Path(description="name of the calibration file, without its ending")]
ResultsId = Annotated[Identifier, Path(description="name of the directory of the results in the run")]
JobId = Annotated[
    str,
    Path(pattern=r"^[A-Za-z0-9][A-Za-z0-9 ._-]{0,699}$", description="made of run, results or calibration, and shot"),
]
ShotIndex = Annotated[int, Path(ge=0, description="position in the run, from 0")]
