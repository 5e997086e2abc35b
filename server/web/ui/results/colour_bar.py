"""ColourBar: which intensity a colour stands for."""

from collections.abc import Sequence

from nicegui import ui

from server.web.ui.results.seen_exposure import FullSlices, SeenExposure


class ColourBar:
    """Built once per page; one bar for each exposure that is shown."""

    def __init__(self) -> None:
        self._box = ui.element("div").classes("colour-bars")

    def show(self, seen: Sequence[SeenExposure], full: FullSlices | None) -> None:
        """Name the intensities of the colours."""
        self._box.clear()
        limits = full.limits if full and not full.problem else {one.frame: one.preview.limit for one in seen}
        with self._box:
            for one in seen:
                shade = "heat" if len(seen) == 1 else one.frame
                with (
                    ui.element("div")
                    .classes("colour-bar")
                    .props(f'role=img aria-label="colours of {one.frame.upper()}"')
                ):
                    ui.label(f"{one.frame.upper()}, intensity 0")
                    ui.element("div").classes(f"colour-ramp {shade}")
                    ui.label(f"{limits[one.frame]:.3g}")
