"""/sign-in and /sign-out: a token becomes a session, whose cookie scripts of other sites neither read nor send."""

import re
from html import escape
from typing import Annotated

from fastapi import APIRouter, Form, Query, Request
from fastapi.responses import HTMLResponse, RedirectResponse, Response

from server.lab.services import Context
from server.web.api.parameters import ContextOf, DoorOf
from server.web.door import Door
from server.web.guard import SIGN_IN_PATH, address_of, cookie_of, session_cookie

router = APIRouter(include_in_schema=False)
SIGN_OUT_PATH = "/sign-out"
_OWN_PAGE = re.compile(r"/([\w.~-][\w.~/-]*)?", re.ASCII)
"""A path of this server; ``//elsewhere`` and ``/\\elsewhere`` would lead away."""
_FORM = """<!doctype html><html lang="en"><meta charset="utf-8"><title>tomoshadow: sign in</title>
<meta name="viewport" content="width=device-width"><link rel="icon" href="data:,">
<style>
body {{ font: 16px system-ui; background: #0f141a; color: #dde5ee; display: grid; place-items: center; height: 90vh }}
form {{ display: grid; gap: 12px; width: 280px }}
input, button {{ font: inherit; padding: 8px; border-radius: 6px; border: 1px solid #456 }}
</style>
<form method="post">
<h1>tomoshadow</h1>
<label for="name">Your name</label>
<input id="name" name="name" maxlength="40" autocomplete="name" autofocus>
<label for="token">Token of an operator or a viewer</label>
<input id="token" name="token" type="password" required>
<button>Sign in</button>
<p role="alert">{message}</p>
<p>You stay signed in until twelve hours after your last page was closed, or the server is started again.</p>
</form>"""


@router.get(SIGN_IN_PATH)
async def show_form() -> HTMLResponse:
    """Ask for the token."""
    return _form("")


@router.post(SIGN_IN_PATH)
async def sign_in(
    token: Annotated[str, Form(max_length=1000)],
    request: Request,
    door: DoorOf,
    context: ContextOf,
    name: Annotated[str, Form(max_length=200)] = "",
    page: Annotated[str, Query(max_length=1000)] = "/",
) -> Response:
    """Check the token, begin a session, and lead to the page that was asked for."""
    address = address_of(request.scope)
    if wait_s := door.tries.wait_s(address):
        return _form(f"Too many wrong tokens: wait {wait_s} s.", 429, {"Retry-After": str(wait_s)})
    role = door.keys.role_of(token)
    if role is None:
        door.tries.count(address)
        return _form("This is not the token.", 401)
    if name.strip() == token:  # compared with no other token: that would tell who tries them
        return _form("What you have written as your name is the token, and no name.", 401)
    _end_session(request, door, context)
    visitor = door.sessions.begin(role, address, name)
    context.services.events.publish("deed", who=visitor.name, text=f"signed in as {role}")
    answer = RedirectResponse(page if _OWN_PAGE.fullmatch(page) else "/", 303)
    answer.headers["Set-Cookie"] = session_cookie(visitor.id, request.headers, request.url.scheme == "https")
    return answer


@router.post(SIGN_OUT_PATH)
async def sign_out(request: Request, door: DoorOf, context: ContextOf) -> Response:
    """End the session, and the control that it holds."""
    _end_session(request, door, context)
    answer = RedirectResponse(SIGN_IN_PATH if door.keys.are_any else "/", 303)
    answer.headers["Set-Cookie"] = session_cookie("", request.headers, request.url.scheme == "https")
    return answer


def _end_session(request: Request, door: Door, context: Context) -> None:
    if visitor := door.sessions.find(cookie_of(request.headers)):
        context.control.release(visitor)
        door.sessions.end(visitor.id)
        context.services.events.publish("deed", who=visitor.name, text="signed out")


def _form(message: str, status: int = 200, headers: dict[str, str] | None = None) -> HTMLResponse:
    return HTMLResponse(_FORM.format(message=escape(message)), status, headers)
