"""EventLog: the last events as lines, for the operator's eye."""

from collections import deque
from datetime import datetime

from nicegui import ui

from server.lab.events import Event
from server.web.ui.theme import panel

_KEPT = 200


class EventLog:
    """Built once per page; gets the events of its timer."""

    def __init__(self) -> None:
        self._lines, self._words = deque[str](maxlen=_KEPT), ""
        with panel("Events"):
            self._log = ui.log(max_lines=_KEPT).classes("w-full text-xs").style("height:150px")
            self._log.props('role=log tabindex=0 aria-label="event log"')

    def add(self, events: list[Event]) -> None:
        """Append events that say something to a person."""
        for event in events:
            if line := line_of(event):
                self._lines.append(line)
                self._show(line)

    def filter(self, words: str) -> None:
        """Show those of the last events that have these words in their line; all of them for none."""
        self._words = words.lower()
        self._log.clear()
        for line in self._lines:
            self._show(line)

    def _show(self, line: str) -> None:
        if self._words in line.lower():
            self._log.push(line)


def line_of(event: Event) -> str | None:
    """One line; None for events that are too many or too small."""
    data = event.data
    match event.name:
        case "run_state":
            whose = f"{data['run_id']}: " if data["run_id"] else ""
            text = whose + data["state"] + (f", {data['message']}" if data["message"] else "")
        case "shot_recorded":
            text = f"shot {data['index']} recorded" + ("" if data["valid"] else ", INVALID")
        case "run_message" | "abort" | "control":
            text = data["text"]
        case "job_changed":
            what = data["kind"] if data["shot"] is None else f"{data['kind']} of shot {data['shot']}"
            text = f"{what}: {data['state']}" + (f", {data['error']}" if data["error"] else "")
        case "deed":
            text = f"{data['who']} {data['text']}"
        case "calibration_alarm":
            text = data["message"] or f"calibration {data['calibration']} fits run {data['run']} again"
        case "calibration_chosen":
            text = f"{data['calibration']} is the current calibration"
        case "background_work":
            text = f"{data['work']}, {data['part']}: {data['error'] or 'works again'}"
        case "file_damaged":
            text = f"{data['file']}: {data['reason']}"
        case _:
            return None
    return f"{datetime.fromisoformat(event.time_utc).astimezone():%H:%M:%S}  {text}"
