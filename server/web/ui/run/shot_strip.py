"""ShotStrip: the shots of the run under way, one mark each, the newest as pictures, and why some are invalid."""

from nicegui import ui

from server.lab.events import Event, EventPublisher
from server.web.ui.run.shot_pictures import ShotPictures

_SHOWN = 150
_CAUSES = 4


class ShotStrip:
    """Built once per page, refreshed by its timer; a page that comes later shows what is still in the events."""

    def __init__(self, events: EventPublisher) -> None:
        self._events = events
        self._seen = 0
        self._run_id: str | None = None
        self._causes: list[str] = []
        self._strip = ui.element("ul").classes("shot-strip").props("role=list aria-label=shots")
        self._pictures = ShotPictures()
        self._invalid = ui.label("").classes("refusal").props('role=status aria-label="invalid shots"')

    def refresh(self, run_id: str | None) -> None:
        """Show the shots of a run that have come since."""
        if run_id != self._run_id:
            self._begin(run_id)
        self._take_new(run_id)
        self._pictures.refresh()

    def _take_new(self, run_id: str | None) -> None:
        new = self._events.since(self._seen)
        if not new:
            return
        self._seen = new[-1].id
        shots = [one for one in new if one.name == "shot_recorded" and one.data["run_id"] == run_id]
        if shots:
            self._pictures.offer(shots)
        with self._strip:
            for shot in shots[-_SHOWN:]:
                self._add(shot)
        for mark in list(self._strip)[:-_SHOWN]:
            mark.delete()
        self._invalid.set_text("\n".join(self._causes[-_CAUSES:]))

    def _begin(self, run_id: str | None) -> None:
        self._run_id, self._seen = run_id, 0
        self._causes.clear()
        self._strip.clear()
        self._pictures.begin()
        self._invalid.set_text("")

    def _add(self, shot: Event) -> None:
        index, fault = shot.data["index"], shot.data["fault"]
        mark = ui.element("li").classes("shot" if shot.data["valid"] else "shot invalid")
        text = f"shot {index}: valid" if shot.data["valid"] else f"shot {index}: INVALID, {fault}"
        mark.props["aria-label"] = mark.props["title"] = text
        if not shot.data["valid"]:
            mark.props["tabindex"] = "0"
            self._causes.append(f"shot {index}: {fault}")
