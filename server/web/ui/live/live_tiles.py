"""LiveTiles: the live view of all cameras as one element of the page."""

from collections.abc import Mapping

from nicegui.element import Element

from daq.devices import Camera
from server.web.api.live import LIVE_PATH
from server.web.api.live_view import PIXELS_PATH


class LiveTiles(Element, component="live_tiles.js"):
    """Tiles of all views, fed by one websocket; only those in sight are asked for.

    Parameters
    ----------
    cameras : Mapping[str, Camera]
        By view, in the order of the feed.
    hint : str
        What to do where there is no picture yet.
    full : bool
        With the choice of exposure and grey scale, figures, cross-hair and loupe.
    """

    def __init__(self, cameras: Mapping[str, Camera], hint: str, *, full: bool = False) -> None:
        super().__init__()
        self.classes("w-full")
        self._props["views"] = list(cameras)
        self._props["shapes"] = [camera.image_shape for camera in cameras.values()]
        self._props["path"] = LIVE_PATH
        self._props["pixels"] = PIXELS_PATH
        self._props["hint"] = hint
        self._props["full"] = full
