"""VolumeView: the exposures of a shot as three linked slices and as surfaces in space, by the method one wants."""

import asyncio
from collections.abc import Sequence

from nicegui import ui

from processing.reconstruction.choices import ReconstructionMethod
from server.lab.errors import ServerError
from server.lab.services import Context
from server.web.ui.results.colour_bar import ColourBar
from server.web.ui.results.looked_at import LookedAt
from server.web.ui.results.seen_exposure import FullSlices, SeenExposure, see, try_full
from server.web.ui.results.slice_group import Dots, Shown, SliceGroup
from server.web.ui.results.surface_view import SurfaceView
from server.web.ui.theme import panel

_BOTH, _OWN = "both", "own"
_EXPOSURES = {"a": "A", "b": "B", _BOTH: "both"}
_PICTURES = {one.value: one.value for one in Shown}


class VolumeView:
    """Built once per page; hidden where there is no volume."""

    def __init__(self, context: Context) -> None:
        self._context = context
        self._looked: LookedAt | None = None
        self._names: dict[str, str] = {}
        self._method: ReconstructionMethod | None = None
        self._dots: Dots = {}
        self._seen: list[SeenExposure] = []
        self._outside: ui.notification | None = None
        self._asked = object()
        self._panel = panel("Volume")
        self._panel.set_visibility(False)
        self._is_built = False

    def _build(self) -> None:
        """Once it is in sight: a scene has no size where nobody sees it."""
        self._is_built = True
        with self._panel:
            with ui.element("div").classes("view-row"):
                self._exposures = ui.toggle(_EXPOSURES, value="a", on_change=self._reload)
                self._exposures.props('dense no-caps unelevated aria-label="exposures"')
                self._pictures = ui.toggle(_PICTURES, value="slices", on_change=self._choose_pictures)
                self._pictures.props('dense no-caps unelevated aria-label="kind of picture"')
                self._reach = ui.number("Region ± / mm", value=1, min=0.05, step=0.5, on_change=self._choose_pictures)
                self._reach.props("dense outlined").classes("region-reach").bind_visibility_from(
                    self._pictures, "value", value=Shown.REGION.value
                )
                self._by = ui.select({_OWN: "as made"}, value=_OWN, label="Slices, region by", on_change=self._sharpen)
                self._by.props("dense outlined options-dense").classes("by-method")
                self._with_droplets = ui.switch("droplets", value=True, on_change=self._mark).props("dense")
                self._state = ui.label("").classes("view-state").props('role=status aria-label="resolution"')
            self._doubts = ui.label("").classes("text-sm").props('role=status aria-label="doubts of this volume"')
            self._bars = ColourBar()
            with ui.element("div").classes("four-up"):
                self._slices = SliceGroup()
                with ui.element("div").classes("slice-part"):
                    self._surface = SurfaceView()

    async def show(self, looked: LookedAt, names: dict[str, str], method: ReconstructionMethod | None) -> None:
        """Show a shot: of its volumes, by exposure, that were made by this method."""
        self._panel.set_visibility(bool(names))
        if (looked, names) == (self._looked, self._names):
            return
        self._looked, self._names, self._dots = looked, names, {}
        self._take_back()
        if names:
            if not self._is_built:
                self._build()
            self._offer(names, method)
            await self._reload()

    def mark(self, dots: Dots) -> None:
        """Show the droplets of the shot."""
        self._dots = dots
        if self._is_built:
            self._with_droplets.set_visibility(bool(dots))
            self._mark()

    def go_to(self, place_mm: tuple[float, float, float], frame: str) -> None:
        """Put the cross-hair somewhere in an exposure, and bring it into sight."""
        if not self._seen:
            return
        self._take_back()
        if frame in self._names and self._exposures.value != _BOTH:
            self._exposures.value = frame
        self._slices.go_to(place_mm)
        ui.run_javascript(f"getHtmlElement({self._panel.id}).scrollIntoView()")
        if beside := self._slices.beside(place_mm):
            text = f"This droplet lies outside of the volume, along {beside}: its row leads to the nearest voxels"
            self._outside = ui.notification(text, timeout=10)

    def _take_back(self) -> None:
        """What was said of one droplet is not said of the next."""
        if self._outside:
            self._outside.dismiss()
            self._outside = None

    def _offer(self, names: dict[str, str], method: ReconstructionMethod | None) -> None:
        self._method = method
        own = f"as made, {method.value.upper()}" if method else "as made"
        others = [one for one in ReconstructionMethod if not one.iterative and one is not method]
        options = {_OWN: own} | {one.value: one.value.upper() for one in others}
        self._by.set_options(options, value=self._by.value if self._by.value in options else _OWN)
        self._exposures.set_visibility(len(names) > 1)
        if self._exposures.value not in (*names, _BOTH):
            self._exposures.value = next(iter(names))

    async def _reload(self) -> None:
        if (looked := self._looked) is None or not self._names:
            return
        chosen = self._exposures.value
        names = {frame: name for frame, name in self._names.items() if chosen in (frame, _BOTH)} or self._names
        try:
            seen = await asyncio.to_thread(see, self._context, looked, names)
        except ServerError as error:
            self._state.set_text(str(error))
            return
        if looked == self._looked and chosen == self._exposures.value:  # nobody has gone on meanwhile
            self._seen = seen
            self._doubts.set_text(doubts_text(seen))
            self._slices.show(seen)
            self._surface.show(seen)
            self._mark()
            await self._sharpen()

    async def _sharpen(self) -> None:
        """Ask whether slices, or the region, are to be had at full resolution by the method that is wanted."""
        if not (seen := self._seen):
            return
        method = None if self._by.value == _OWN else ReconstructionMethod(self._by.value)
        self._bars.show(seen, None)
        self._state.set_text("preview, full resolution is being made")
        asked = self._asked = object()
        full = await asyncio.to_thread(self._try_full, seen, method)
        if asked is self._asked:
            self._slices.sharpen(full)
            self._bars.show(seen, full)
            self._state.set_text(state_text(full, self._method))

    def _try_full(self, seen: list[SeenExposure], method: ReconstructionMethod | None) -> FullSlices:
        if self._pictures.value == Shown.MAXIMA:
            return FullSlices(
                method, {}, "these are the largest values of all of the volume; region has those of a part"
            )
        return try_full(self._context, seen, self._slices.parts_mm, method)

    async def _choose_pictures(self) -> None:
        if self._reach.value:
            self._slices.choose(Shown(self._pictures.value), self._reach.value)
            await self._sharpen()

    def _mark(self) -> None:
        chosen = self._exposures.value
        shown = [frame for frame in self._dots if self._with_droplets.value and chosen in (frame, _BOTH)]
        dots = {frame: self._dots[frame] for frame in shown}
        self._slices.mark(dots)
        self._surface.mark(dots)


def doubts_text(seen: Sequence[SeenExposure]) -> str:
    """What speaks against the exposures that are shown; empty where nothing does."""
    return "; ".join(f"exposure {one.frame.upper()}: {doubt}" for one in seen for doubt in one.doubts)


def state_text(full: FullSlices, made_by: ReconstructionMethod | None) -> str:
    """What slices or region show: by which method, how finely, and why not otherwise."""
    own = made_by.value.upper() if made_by else "as made"
    if full.problem:
        return f"{own}, preview only: {full.problem}"
    return f"{full.method.value.upper() if full.method else own}, full resolution"
