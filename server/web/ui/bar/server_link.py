"""ServerLink: whether the page hears the server; without it the page is grey and locked, but for ABORT."""

from nicegui.element import Element
from pydantic import ValidationError

from server.lab.desk.beat import NEVER, PERIOD_S
from server.lab.starting.light_request import LightRequest
from server.web.api.desk.beat import BEAT_PATH
from server.web.ui.visiting import visitor

TICKET = "() => emit(window.desk?.ticket() ?? {})"
"""Handler in the browser of every button that makes light: which beat was heard last, and what the form shows."""
BEATS_PER_S = round(1 / PERIOD_S)


class ServerLink(Element, component="server_link.js"):
    """Listens to the beat of the server."""

    def __init__(self) -> None:
        super().__init__()
        self._props["path"] = BEAT_PATH
        self._props |= {"shown": 0, "state": "", "place": ""}

    def show(self, beat: int, state: str, place: str) -> None:
        """Tell the page, by the way of all that it shows, which beat that is of, once a second; and its title."""
        title = {"state": state, "place": place}
        if beat - self._props["shown"] >= BEATS_PER_S or title != {name: self._props[name] for name in title}:
            self._props |= {"shown": beat, **title}
            self.update()


def light_request(ticket: object) -> LightRequest:
    """What a click said of itself; one that says nothing heard no beat, and makes no light."""
    try:
        request = LightRequest.model_validate({name: _said(ticket).get(name) for name in ("key", "beat")})
    except ValidationError:
        request = LightRequest()
    beat = NEVER if request.beat is None else request.beat
    return LightRequest(key=request.key, beat=beat, who=visitor())


def shown_form(ticket: object) -> dict[str, str]:
    """What the fields of the form showed when somebody clicked, by their names."""
    form = _said(ticket).get("form")
    return {str(name): str(text) for name, text in form.items()} if isinstance(form, dict) else {}


def _said(ticket: object) -> dict[str, object]:
    return ticket if isinstance(ticket, dict) else {}
