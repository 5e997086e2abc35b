"""ShotPictures: the newest shots of the run under way as small pictures, one a second at most."""

import time
from collections.abc import Sequence

from nicegui import ui

from server.lab.events import Event

_EVERY_S = 1.0
"""A picture takes the reading of a whole shot."""
_SHOWN = 6


class ShotPictures:
    """Built once per page, refreshed by its timer."""

    def __init__(self) -> None:
        self._row = ui.element("div").classes("shot-pictures").props('role=group aria-label="newest shots"')
        self._next: list[Event] = []
        self._drawn_s: float | None = None

    def begin(self) -> None:
        """Another run."""
        self._row.clear()
        self._next, self._drawn_s = [], None

    def offer(self, shots: Sequence[Event]) -> None:
        """Shots are on the disk: a page that comes later shows the last ones, any other the newest when it is time."""
        self._next = list(shots[-_SHOWN:] if self._drawn_s is None else shots[-1:])

    def refresh(self) -> None:
        """Show what is new, if it is time."""
        if not self._next or (self._drawn_s is not None and time.monotonic() - self._drawn_s < _EVERY_S):
            return
        with self._row:
            for shot in self._next:
                _draw(shot)
        for old in list(self._row)[:-_SHOWN]:
            old.delete()
        self._next, self._drawn_s = [], time.monotonic()


def _draw(shot: Event) -> None:
    run_id, index, fault = shot.data["run_id"], shot.data["index"], shot.data["fault"]
    with ui.element("figure").classes("" if shot.data["valid"] else "invalid") as figure:
        picture = ui.element("img").props(f'alt="shot {index}"')
        picture.props["src"] = f"/api/runs/{run_id}/thumbnail.jpg?shot={index}"
        with ui.element("figcaption"):
            ui.label(f"{index}")
    figure.props["title"] = f"shot {index}: INVALID, {fault}" if fault else f"shot {index}"
