"""SliceView: a slice across one axis as an element of the page, with axes in mm and a cross-hair."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass

from nicegui.element import Element
from nicegui.events import GenericEventArguments

from processing.volume import VoxelGrid
from server.web.ui.results.ticks import ticks_of

SHOWN_AXES = {"z": "xy", "x": "zy", "y": "xz"}
"""Across which axis -> to the right, and down: as the pictures of REST are."""
_PICK_S = 0.05
Span = tuple[float, float]


@dataclass(frozen=True)
class Layer:
    """Pictures of one exposure.

    Parameters
    ----------
    key : str
        Stays the same as long as the exposure does.
    preview, full : str
        Addresses; empty where there is none.
    preview_mm, full_mm : ((float, float), (float, float))
        What they cover, to the right and down.
    """

    key: str
    preview: str
    preview_mm: tuple[Span, Span]
    full: str
    full_mm: tuple[Span, Span]


class SliceView(Element, component="slice_view.js"):
    """A slice across an axis.

    Parameters
    ----------
    axis : {"x", "y", "z"}
        Across which it lies.
    on_pick : Callable[[str, float, float], None]
        Gets the axis, and where the cross-hair was put: to the right and down, in mm.
    """

    def __init__(self, axis: str, on_pick: Callable[[str, float, float], None]) -> None:
        super().__init__()
        self.axis = axis
        self._props.update(
            label=f"slice {axis}", names=list(SHOWN_AXES[axis]), range_mm=[[0, 1], [0, 1]], ticks=[[], []]
        )
        self._props.update(at=[0, 0], layers=[], dots=[], framed=None, tallest=320)

        def pick(event: GenericEventArguments) -> None:
            on_pick(axis, float(event.args[0]), float(event.args[1]))

        self.on("pick", pick, throttle=_PICK_S)

    def place(self, grid: VoxelGrid) -> None:
        """Show what lies on a grid."""
        spans = spans_of(grid, self.axis)
        self._props.update(range_mm=spans, ticks=[ticks_of(*span) for span in spans])
        self.update()

    def show(self, layers: Sequence[Layer]) -> None:
        """Show these pictures, one upon the other."""
        self._props["layers"] = [asdict(layer) for layer in layers]
        self.update()

    def point_out(
        self,
        at_mm: dict[str, float],
        dots: Sequence[tuple[float, float, float, str]],
        region_mm: dict[str, Span] | None = None,
    ) -> None:
        """Put the cross-hair, circles (to the right, down, radius in px, class), and a frame around a region."""
        across = SHOWN_AXES[self.axis]
        self._props.update(at=[at_mm[name] for name in across], dots=[list(dot) for dot in dots])
        self._props["framed"] = region_mm and [region_mm[name] for name in across]
        self.update()


def spans_of(grid: VoxelGrid, axis: str) -> tuple[Span, Span]:
    """What a slice across an axis covers, to the right and down, from edge to edge of its voxels."""
    first, second = (edges_of(grid, name) for name in SHOWN_AXES[axis])
    return first, second


def edges_of(grid: VoxelGrid, name: str) -> Span:
    """Where a grid begins and ends along an axis."""
    centres = getattr(grid, f"{name}_mm")
    return float(centres[0]) - 0.5 * grid.pitch_mm, float(centres[-1]) + 0.5 * grid.pitch_mm
