"""Drawer: jobs and events beside every page; a button of the rail opens it."""

from nicegui import ui

from server.lab.events import Event
from server.lab.services import Context
from server.web.ui.drawer.event_log import EventLog
from server.web.ui.drawer.job_panel import JobPanel

_EVENTS_SHOWN = 100


class Drawer:
    """Built once per tab; closed at first.

    Parameters
    ----------
    context : Context
        The application.
    button : ui.button
        Opens and closes it.
    """

    def __init__(self, context: Context, button: ui.button) -> None:
        self._events = context.services.events
        self._seen = max(0, self._events.newest - _EVENTS_SHOWN)
        with ui.element("aside").classes("drawer").props('aria-label="jobs and events"') as self._box:
            words = ui.input("Filter jobs and events").props("dense outlined debounce=200")
            self._jobs, self._log = JobPanel(context), EventLog()
        words.on_value_change(lambda: self._filter(words.value))
        self._box.set_visibility(False)
        button.on_click(lambda: self._box.set_visibility(not self._box.visible))

    def new_events(self) -> list[Event]:
        """Events since the last call; those that say something to a person are in the log."""
        events = self._events.since(self._seen)
        self._log.add(events)
        if events:
            self._seen = events[-1].id
        return events

    def _filter(self, words: str) -> None:
        self._jobs.filter(words)
        self._log.filter(words)

    async def reload(self) -> None:
        """Read the jobs again."""
        await self._jobs.reload()
