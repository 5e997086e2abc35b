"""Visitor: who asks for something, a browser or a script."""

from dataclasses import dataclass
from enum import StrEnum


class Role(StrEnum):
    """What a visitor may do."""

    OPERATOR = "operator"
    VIEWER = "viewer"


@dataclass(frozen=True)
class Visitor:
    """Who asks.

    Parameters
    ----------
    id : str
        The same for all requests of one browser, and secret; empty for somebody who did not say who he is.
    name : str
        What others are told.
    role : Role
        A viewer looks, and ends the light.
    """

    id: str
    name: str
    role: Role = Role.OPERATOR


def named_script(name: str, role: Role = Role.OPERATOR) -> Visitor:
    """A script that says who runs it."""
    return Visitor(f"script {name}", name, role)


def unnamed_script(address: str, role: Role = Role.OPERATOR) -> Visitor:
    """A script that does not."""
    return Visitor("", f"a script at {address}", role)
