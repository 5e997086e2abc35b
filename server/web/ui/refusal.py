"""Refusal: why a click was refused, for as long as it is true, and as a person has to read it."""

import time
from collections.abc import Callable

from nicegui import ui

_READ_S = 5.0
"""So long a person has to read it, at least."""


class Refusal:
    """A line on a page; empty while nothing was refused.

    Parameters
    ----------
    basis : Callable[[], object]
        What a refusal is about: once that has changed, nobody knows whether the click would be refused again.
    name : str
        What a screen reader calls it.
    """

    def __init__(self, basis: Callable[[], object], name: str) -> None:
        self._basis = basis
        self._label = ui.label("").classes("refusal").props(f'role=alert aria-label="{name}"')
        self._refused_s = -_READ_S
        self._of: object = None

    def show(self, text: str) -> None:
        """Say why the click was refused."""
        self._label.set_text(text)
        self._refused_s, self._of = time.monotonic(), self._basis()

    def clear(self) -> None:
        """The click was obeyed."""
        self._label.set_text("")

    def follow(self, text: str = "") -> None:
        """Tell what is so by now in place of a refusal that was to be read, once what it was about has changed."""
        if self._of != (basis := self._basis()) and time.monotonic() - self._refused_s >= _READ_S:
            self._of = basis
            self._label.set_text(text)
