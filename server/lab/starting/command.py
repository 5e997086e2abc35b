"""Command: what changes rig, plan or calibration needs control, and everybody is told who did it."""

from collections.abc import Callable
from typing import TypeVar

from server.lab.desk.visitor import Visitor
from server.lab.services import Context

Answer = TypeVar("Answer")


def command(context: Context, who: Visitor, deed: str, action: Callable[[], Answer]) -> Answer:
    """Do it for who holds control, or takes it because it is free.

    Raises
    ------
    Forbidden, Locked
        A viewer asks, or somebody else holds control.
    """
    with context.control.acting(who):
        answer = action()
    tell_deed(context, who, deed)
    return answer


def tell_deed(context: Context, who: Visitor, deed: str) -> None:
    """Let everybody know who did something."""
    context.services.events.publish("deed", who=who.name, text=deed)
