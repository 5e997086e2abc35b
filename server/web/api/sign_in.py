"""/sign-in: the token becomes a cookie that scripts of other sites neither read nor send."""

from typing import Annotated

from fastapi import APIRouter, Form, Request
from fastapi.responses import HTMLResponse, RedirectResponse, Response

from server.web.api.parameters import ContextOf
from server.web.guard import COOKIE, SIGN_IN_PATH, is_token

router = APIRouter(include_in_schema=False)
_FORM = """<!doctype html><html lang="en"><meta charset="utf-8"><title>tomoshadow</title>
<style>
body {{ font: 16px system-ui; background: #0f141a; color: #dde5ee; display: grid; place-items: center; height: 90vh }}
form {{ display: grid; gap: 12px; width: 280px }}
input, button {{ font: inherit; padding: 8px; border-radius: 6px; border: 1px solid #456 }}
</style>
<form method="post">
<h1>tomoshadow</h1>
<label for="token">Operator token</label>
<input id="token" name="token" type="password" autofocus required>
<button>Sign in</button>
<p role="alert">{message}</p>
</form>"""


@router.get(SIGN_IN_PATH)
async def show_form() -> HTMLResponse:
    """Ask for the token."""
    return HTMLResponse(_FORM.format(message=""))


@router.post(SIGN_IN_PATH)
async def sign_in(token: Annotated[str, Form()], request: Request, context: ContextOf) -> Response:
    """Check the token and remember it for this browser."""
    expected = context.services.config.server.token
    if expected is None or not is_token(token, expected.get_secret_value()):
        return HTMLResponse(_FORM.format(message="This is not the token."), 401)
    answer = RedirectResponse("/", 303)
    answer.set_cookie(COOKIE, token, httponly=True, samesite="strict", secure=request.url.scheme == "https")
    return answer
