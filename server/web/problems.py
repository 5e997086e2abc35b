"""Errors as RFC 9457 problem documents: one table from error type to HTTP status."""

import logging
from collections.abc import Mapping
from http import HTTPStatus
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from pydantic import BaseModel, ConfigDict, Field
from starlette.exceptions import HTTPException
from starlette.requests import HTTPConnection

from daq.errors import (
    AlreadyHeld,
    BusyError,
    DaqError,
    DeviceError,
    DeviceTimeout,
    InterlockOpen,
    NotAcknowledged,
    PlanError,
    RecorderError,
    ShotFileError,
)
from daq.run.refusals import REMEDIES
from server.lab.desk import control
from server.lab.errors import Conflict, Damaged, Forbidden, Locked, NotFound, ServerError, Stale, Unprocessable

MEDIA_TYPE = "application/problem+json"
_LOG = logging.getLogger(__name__)


class Problem(BaseModel):
    """A problem document; ``detail`` is for the operator and names device, value and limit."""

    model_config = ConfigDict(extra="allow")

    type: str = Field("about:blank", description="kind of problem, urn:tomoshadow:<error>")
    title: str = Field(description="phrase of the status")
    status: int = Field(description="HTTP status")
    detail: str | None = Field(None, description="what is wrong, for the operator")
    instance: str | None = Field(None, description="path of the request")
    code: str | None = Field(None, description="for programs: why a start was refused, as in the readiness of the rig")
    remedy: str | None = Field(None, description="what to do about it, for the operator")


STATUS_OF: dict[type[Exception], HTTPStatus] = {
    PlanError: HTTPStatus.UNPROCESSABLE_ENTITY,
    AlreadyHeld: HTTPStatus.CONFLICT,
    BusyError: HTTPStatus.CONFLICT,
    InterlockOpen: HTTPStatus.LOCKED,
    NotAcknowledged: HTTPStatus.LOCKED,
    DeviceTimeout: HTTPStatus.GATEWAY_TIMEOUT,
    DeviceError: HTTPStatus.SERVICE_UNAVAILABLE,
    RecorderError: HTTPStatus.INSUFFICIENT_STORAGE,
    ShotFileError: HTTPStatus.INTERNAL_SERVER_ERROR,
    DaqError: HTTPStatus.INTERNAL_SERVER_ERROR,
    NotFound: HTTPStatus.NOT_FOUND,
    Conflict: HTTPStatus.CONFLICT,
    Forbidden: HTTPStatus.FORBIDDEN,
    Locked: HTTPStatus.LOCKED,
    Stale: HTTPStatus.PRECONDITION_FAILED,
    Damaged: HTTPStatus.INTERNAL_SERVER_ERROR,
    Unprocessable: HTTPStatus.UNPROCESSABLE_ENTITY,
}
"""The nearest base class in this table decides."""


_REMEDIES: Mapping[str, str] = {
    **control.REMEDIES,
    **{code.value: remedy for code, remedy in REMEDIES.items()},
    "stale_request": "look at the rig, and ask again",
    "in_progress": "wait for the answer of the first request",
    "outcome_unknown": "look at the rig and its runs, then ask with a new key",
    "calibration_refused": "choose another calibration, or calibrate again",
    "key_reused": "choose a new key for every request",
}


def _status_of(error: Exception) -> HTTPStatus:
    """HTTP status of an error, by its type."""
    return next((STATUS_OF[kind] for kind in type(error).__mro__ if kind in STATUS_OF), HTTPStatus(500))


def _phrase(status: int) -> str:
    """Phrases of RFC 9110, which Python before 3.13 does not have."""
    newer = {HTTPStatus.UNPROCESSABLE_ENTITY: "Unprocessable Content", HTTPStatus(413): "Content Too Large"}
    return newer.get(HTTPStatus(status), HTTPStatus(status).phrase)


def responses(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """Declare problem documents in the OpenAPI schema of a router or route."""
    return {
        status: {
            "description": _phrase(status),
            "content": {MEDIA_TYPE: {"schema": {"$ref": "#/components/schemas/Problem"}}},
        }
        for status in statuses
    }


def problem(
    request: HTTPConnection, status: int, detail: str | None, kind: str = "about:blank", **more: Any
) -> JSONResponse:
    """Build the answer."""
    document = Problem(
        type=kind, title=_phrase(status), status=status, detail=detail, instance=request.url.path, **more
    )
    return JSONResponse(document.model_dump(exclude_none=True), status, media_type=MEDIA_TYPE)


def install(app: FastAPI) -> None:
    """Answer every error of this application with a problem document."""
    app.add_exception_handler(DaqError, _on_known_error)
    app.add_exception_handler(ServerError, _on_known_error)
    app.exception_handler(RequestValidationError)(_on_invalid_request)
    app.exception_handler(HTTPException)(_on_http_error)
    app.add_exception_handler(Exception, _on_unknown_error)


def describe(app: FastAPI) -> None:
    """Put the problem document into the OpenAPI schema, in the place of FastAPI's own error bodies."""
    generate = app.openapi

    def openapi() -> dict[str, Any]:
        schema = generate()
        schemas = schema["components"]["schemas"]
        schemas["Problem"] = Problem.model_json_schema()
        for name in ("HTTPValidationError", "ValidationError"):
            schemas.pop(name, None)
        return schema

    app.openapi = openapi  # type: ignore[method-assign]


async def _on_known_error(request: Request, error: Exception) -> JSONResponse:
    more: dict[str, str | None] = {"device": error.device} if isinstance(error, DeviceError) else {}
    if isinstance(error, DaqError | ServerError) and error.code:
        more |= {"code": error.code, "remedy": _REMEDIES.get(error.code)}
    return problem(request, _status_of(error), str(error), f"urn:tomoshadow:{type(error).__name__}", **more)


async def _on_invalid_request(request: Request, error: RequestValidationError) -> JSONResponse:
    errors = [{"at": "/".join(map(str, item["loc"])), "message": item["msg"]} for item in error.errors()]
    detail = "; ".join(f"{item['at']}: {item['message']}" for item in errors)
    return problem(request, 422, detail, "urn:tomoshadow:InvalidRequest", errors=errors)


async def _on_http_error(request: Request, error: HTTPException) -> JSONResponse:
    answer = problem(request, error.status_code, error.detail)
    answer.headers.update(error.headers or {})
    return answer


async def _on_unknown_error(request: Request, error: Exception) -> JSONResponse:
    _LOG.error("%s %s", request.method, request.url.path, exc_info=error)
    return problem(request, 500, None)
