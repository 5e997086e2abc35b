"""AbortButton: light off by plain requests, whatever the page and its socket are busy with."""

from nicegui.element import Element

from server.web.abort_listener import PATH


class AbortButton(Element, component="abort_button.js"):
    """A button that stays alive without a connection, and its hot key.

    Parameters
    ----------
    port : int
        Of the second door, for ABORT alone; the server itself is asked too.
    """

    def __init__(self, port: int) -> None:
        super().__init__()
        self._props["port"] = port
        self._props["paths"] = [PATH, "/api/rig/abort"]
