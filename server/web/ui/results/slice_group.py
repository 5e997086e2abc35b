"""SliceGroup: three slices through one place, each with its slider; a click in one moves the two others.

In their place it shows the largest values of a cube around that place, or of all, along each axis.
"""

from collections.abc import Callable, Sequence
from enum import StrEnum
from urllib.parse import urlencode

import numpy as np
from nicegui import ui
from numpy.typing import NDArray

from processing.reconstruction.volume_part import RangesMm, part_within
from processing.volume import VoxelGrid
from server.pictures.pictures import Colours
from server.web.ui.results.seen_exposure import AXES, SHADES, FullSlices, SeenExposure
from server.web.ui.results.slice_view import SHOWN_AXES, Layer, SliceView, edges_of, spans_of

_REST_S = 0.2
"""Full resolution is asked for once the hand rests."""
_MOST_DOTS = 300
Dots = dict[str, NDArray[np.float64]]
"""Points x, y, z in mm, (N, 3), by exposure."""


class Shown(StrEnum):
    """What the pictures show."""

    SLICES = "slices"
    REGION = "region"
    MAXIMA = "maxima"


class FreeSlider(ui.slider):
    """A slider that the server does not pull back while it is being dragged; arrow keys move it by one."""

    LOOPBACK = False


class SliceGroup:
    """Built once per page, inside of a grid that has room for a fourth part."""

    def __init__(self) -> None:
        self._seen: Sequence[SeenExposure] = ()
        self._full: FullSlices | None = None
        self._grid = VoxelGrid((1, 1, 1), (0.0, 0.0, 0.0), 1.0)
        self._at: dict[str, int] = dict.fromkeys(AXES, 0)
        self._rested: dict[str, int] = {}
        self._dots: Dots = {}
        self._shown = Shown.SLICES
        self._reach_mm = 1.0
        self._views: dict[str, SliceView] = {}
        self._labels: dict[str, ui.label] = {}
        self._sliders: dict[str, FreeSlider] = {}
        for axis in AXES:
            with ui.element("div").classes("slice-part"):
                self._build(axis)
        self._rest = ui.timer(_REST_S, self._settle, active=False)

    def _build(self, axis: str) -> None:
        self._labels[axis] = ui.label("").classes("text-xs").props(f'role=status aria-label="place {axis}"')
        self._views[axis] = SliceView(axis, self._pick)
        self._sliders[axis] = FreeSlider(min=0, max=1, value=0, on_change=self._mover(axis))
        self._sliders[axis].props(f'dense aria-label="slice {axis}"')

    @property
    def at_mm(self) -> dict[str, float]:
        """Where the cross-hair is."""
        return {axis: float(getattr(self._grid, f"{axis}_mm")[number]) for axis, number in self._at.items()}

    def show(self, seen: Sequence[SeenExposure]) -> None:
        """Show other exposures: at the same place, or where there is something if they lie elsewhere."""
        grid = seen[0].preview.full_grid
        self._seen, self._full, self._rested = seen, None, {}
        if grid != self._grid:
            self._grid = grid
            for axis in AXES:
                self._views[axis].place(grid)
                self._sliders[axis].props(f"max={len(getattr(grid, f'{axis}_mm')) - 1}")
            self.go_to(seen[0].preview.fullest_mm)
        self._draw()

    def sharpen(self, full: FullSlices) -> None:
        """From now on there are slices at full resolution, or there are none."""
        self._full = full
        self._settle()

    @property
    def parts_mm(self) -> list[RangesMm]:
        """What is wanted at full resolution: three planes, or a region."""
        at_mm = self.at_mm
        if self._shown is Shown.REGION:
            return [self._region_mm()]
        return [{axis: (at_mm[axis], at_mm[axis])} for axis in AXES]

    def choose(self, shown: Shown, reach_mm: float) -> None:
        """Show slices, maxima of the cube that reaches so far around the cross-hair, or of all."""
        self._shown, self._reach_mm, self._full = shown, reach_mm, None
        self._draw()

    def _region_mm(self) -> dict[str, tuple[float, float]]:
        at_mm = self.at_mm
        return {axis: (at_mm[axis] - self._reach_mm, at_mm[axis] + self._reach_mm) for axis in AXES}

    def mark(self, dots: Dots) -> None:
        """Show droplets."""
        self._dots = dots
        self._draw()

    def go_to(self, place_mm: Sequence[float]) -> None:
        """Put the cross-hair to x, y, z, as near as there are planes."""
        index = self._grid.to_index(np.array([place_mm], np.float64))[0]
        for axis, number in zip("zyx", index.tolist(), strict=True):
            self._put(axis, round(number))
        self._draw()

    def beside(self, place_mm: Sequence[float]) -> str:
        """Along which axes the volume does not reach a place x, y, z; empty: it does."""
        spans = (edges_of(self._grid, axis) for axis in "xyz")
        outside = [not low <= at_mm <= high for at_mm, (low, high) in zip(place_mm, spans, strict=True)]
        return ", ".join(axis for axis, is_outside in zip("xyz", outside, strict=True) if is_outside)

    def _pick(self, axis: str, right_mm: float, down_mm: float) -> None:
        place_mm = self.at_mm | dict(zip(SHOWN_AXES[axis], (right_mm, down_mm), strict=True))
        self.go_to([place_mm[name] for name in "xyz"])

    def _mover(self, axis: str) -> Callable[[], None]:
        def move() -> None:
            number = int(self._sliders[axis].value)
            if number != self._at[axis]:  # moved by a hand, not by ``_put``
                self._put(axis, number)
                self._draw()

        return move

    def _put(self, axis: str, number: int) -> None:
        self._at[axis] = min(max(number, 0), len(getattr(self._grid, f"{axis}_mm")) - 1)
        self._sliders[axis].value = self._at[axis]

    def _settle(self) -> None:
        self._rest.deactivate()
        self._rested = dict(self._at)
        self._draw()

    def _draw(self) -> None:
        if not self._seen:
            return
        at_mm = self.at_mm
        region_mm = self._region_mm() if self._shown is Shown.REGION else None
        for axis in AXES:
            self._labels[axis].set_text(self._place_text(axis, at_mm[axis]))
            self._views[axis].point_out(at_mm, self._dots_near(axis, at_mm[axis]), region_mm)
            self._views[axis].show([self._layer(axis, one) for one in self._seen])
        if self._rested != self._at:
            self._rest.activate()

    def _place_text(self, axis: str, place_mm: float) -> str:
        if self._shown is Shown.REGION:
            return f"maximum along {axis}, {place_mm - self._reach_mm:.3f} to {place_mm + self._reach_mm:.3f} mm"
        return f"maximum along {axis}" if self._shown is Shown.MAXIMA else f"{axis} = {place_mm:.3f} mm"

    def _layer(self, axis: str, one: SeenExposure) -> Layer:
        colours = Colours.HEAT if len(self._seen) == 1 else SHADES[one.frame]
        preview, full_grid = one.preview.grid, one.preview.full_grid
        shade = f"?colours={colours.value}"
        if self._shown is Shown.MAXIMA:
            address = f"{one.folder}/projections/{axis}.png{shade}"
        else:
            number = int(np.abs(getattr(preview, f"{axis}_mm") - self.at_mm[axis]).argmin())
            address = f"{one.folder}/slices/{axis}/{number}.png{shade}"
        full = self._full_address(axis, one, colours)
        if full and self._shown is Shown.REGION:
            full_grid = part_within(full_grid, self._region_mm()).grid(full_grid)
        return Layer(one.folder, address, spans_of(preview, axis), full, spans_of(full_grid, axis))

    def _full_address(self, axis: str, one: SeenExposure, colours: Colours) -> str:
        is_region = self._shown is Shown.REGION
        is_at_rest = self._rested == self._at if is_region else self._rested.get(axis) == self._at[axis]
        if self._shown is Shown.MAXIMA or self._full is None or self._full.problem or not is_at_rest:
            return ""
        asked = {"axis": axis, "colours": colours.value}
        if is_region:
            asked |= {f"{name}_mm": f"{low:.6f}:{high:.6f}" for name, (low, high) in self._region_mm().items()}
            asked["limit"] = repr(self._full.limits[one.frame])
        else:
            asked["at_mm"] = repr(self.at_mm[axis])
        if self._full.method is not None:
            asked |= {"method": self._full.method.value, "limit": repr(self._full.limits[one.frame])}
        return f"{one.folder}/{'region' if is_region else 'slice'}.png?{urlencode(asked)}"

    def _dots_near(self, axis: str, place_mm: float) -> list[tuple[float, float, float, str]]:
        """Droplets that a slice shows: those within one voxel of the preview; of a region its own; of maxima, all."""
        pitch_mm = self._seen[0].preview.grid.pitch_mm
        reach_mm = {Shown.SLICES: pitch_mm, Shown.REGION: self._reach_mm, Shown.MAXIMA: np.inf}[self._shown]
        found: list[tuple[float, float, float, str]] = []
        for frame, points_mm in self._dots.items():
            near = points_mm[np.abs(points_mm[:, "xyz".index(axis)] - place_mm) <= reach_mm]
            right, down = ("xyz".index(name) for name in SHOWN_AXES[axis])
            found += [(x, y, 5.0, frame) for x, y in near[:, [right, down]].tolist()]
        return found[:_MOST_DOTS]
