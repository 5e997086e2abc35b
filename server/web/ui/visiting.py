"""Who sits before the page, as the guard has found; asked anew for everything that is clicked."""

from dataclasses import replace
from typing import TypeVar

from nicegui import ui
from nicegui.elements.mixins.disableable_element import DisableableElement

from server.lab.desk.control import REMEDIES
from server.lab.desk.visitor import Role, Visitor
from server.lab.errors import Forbidden, Locked
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


Control = TypeVar("Control", bound=DisableableElement)
VIEWERS_MAY = "a viewer may look and end the light, and do nothing else"


def is_viewer() -> bool:
    """Whether who looks may do nothing else."""
    return visitor().role is Role.VIEWER


def for_operators(control: Control, may: bool = True, why: str = "") -> Control:
    """Lock a control where it may not be used, and say why where one points at it; a viewer never may."""
    is_locked, why = is_viewer(), VIEWERS_MAY if is_viewer() else why
    if why != control.props.get("title", ""):
        control.props.set_bool("title", why)
    control.set_enabled(may and not is_locked and not why)
    return control


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
    if is_viewer():
        raise Forbidden(VIEWERS_MAY, "viewer")
    return visitor()


def may_command(context: Context) -> bool:
    """Whether who looks may make light and change its form: no viewer, and nobody while somebody else holds control."""
    return not why_not(context)


def why_not(context: Context) -> str:
    """Why who looks may change nothing now, in a few words for what he points at; empty: he may."""
    try:
        context.control.check(visitor())
    except Forbidden:
        return VIEWERS_MAY
    except Locked as error:
        return f"{error}: the hand in the bar takes it over"
    return ""


def told(error: Exception) -> str:
    """Why something was refused, and what to do about it, where that is about who asks."""
    remedy = REMEDIES.get(getattr(error, "code", ""))
    return f"{error}: {remedy}" if remedy else str(error)


def _sessions() -> Sessions:
    sessions: Sessions = ui.context.client.request.scope[SESSIONS]
    return sessions
