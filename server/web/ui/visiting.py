"""Who sits before the page, as the guard has found; asked anew for everything that is clicked."""

from dataclasses import replace

from nicegui import ui

from server.lab.desk.control import REMEDIES
from server.lab.desk.visitor import Role, Visitor
from server.lab.errors import Forbidden, ServerError
from server.lab.services import Context
from server.web.guard import SESSIONS, VISITOR
from server.web.sessions import Sessions


def visitor() -> Visitor:
    """Who has clicked; somebody whose session is over may look, and nothing else."""
    scope = ui.context.client.request.scope
    whoever: Visitor = scope[VISITOR]
    if not whoever.id:
        return whoever
    return _sessions().find(whoever.id) or replace(whoever, id="", role=Role.VIEWER)


def is_signed_in() -> bool:
    """Whether the session that opened this page goes on."""
    whoever: Visitor = ui.context.client.request.scope[VISITOR]
    return not whoever.id or _sessions().find(whoever.id) is not None


def rename(name: str) -> Visitor:
    """The operator says who he is."""
    _sessions().rename(visitor().id, name)
    return visitor()


def require_operator() -> Visitor:
    """Who has clicked, if he may do more than look; Forbidden otherwise."""
    who = visitor()
    if who.role is Role.VIEWER:
        raise Forbidden("a viewer may look and end the light, and do nothing else", "viewer")
    return who


def may_command(context: Context) -> bool:
    """Whether who looks may make light and change its form: no viewer, and nobody while somebody else holds control."""
    try:
        context.control.check(visitor())
    except ServerError:
        return False
    return True


def told(error: Exception) -> str:
    """Why something was refused, and what to do about it, where that is about who asks."""
    remedy = REMEDIES.get(getattr(error, "code", ""))
    return f"{error}: {remedy}" if remedy else str(error)


def _sessions() -> Sessions:
    sessions: Sessions = ui.context.client.request.scope[SESSIONS]
    return sessions
