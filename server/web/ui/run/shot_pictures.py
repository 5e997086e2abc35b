"""ShotPictures: the newest shots of the run under way as small pictures, one a second at most."""

import time

from nicegui import ui

from server.lab.events import Event

_EVERY_S = 1.0
"""A picture takes the reading of a whole shot."""
_SHOWN = 6


class ShotPictures:
    """Built once per page, refreshed by its timer."""

    def __init__(self) -> None:
        self._row = ui.element("div").classes("shot-pictures").props('role=group aria-label="newest shots"')
        self._next: Event | None = None
        self._drawn_s = 0.0

    def begin(self) -> None:
        """Another run."""
        self._row.clear()
        self._next, self._drawn_s = None, 0.0

    def offer(self, shot: Event) -> None:
        """A shot is on the disk; it is shown unless a newer one comes before it is time."""
        self._next = shot

    def refresh(self) -> None:
        """Show the newest shot, if it is time."""
        if self._next is None or time.monotonic() - self._drawn_s < _EVERY_S:
            return
        with self._row:
            _draw(self._next)
        for old in list(self._row)[:-_SHOWN]:
            old.delete()
        self._next, self._drawn_s = None, time.monotonic()


def _draw(shot: Event) -> None:
    run_id, index, fault = shot.data["run_id"], shot.data["index"], shot.data["fault"]
    with ui.element("figure").classes("" if shot.data["valid"] else "invalid") as figure:
        picture = ui.element("img").props(f'alt="shot {index}"')
        picture.props["src"] = f"/api/runs/{run_id}/thumbnail.jpg?shot={index}"
        with ui.element("figcaption"):
            ui.label(f"{index}")
    figure.props["title"] = f"shot {index}: INVALID, {fault}" if fault else f"shot {index}"
