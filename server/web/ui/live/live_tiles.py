"""LiveTiles: the live view of all cameras as one element of the page."""

from collections.abc import Sequence

from nicegui.element import Element

from server.web.api.live import LIVE_PATH


class LiveTiles(Element, component="live_tiles.js"):
    """Tiles of all views, fed by one websocket.

    Parameters
    ----------
    views : sequence of str
        Names of the views in the order of the feed.
    """

    def __init__(self, views: Sequence[str]) -> None:
        super().__init__()
        self._props["views"] = list(views)
        self._props["path"] = LIVE_PATH
