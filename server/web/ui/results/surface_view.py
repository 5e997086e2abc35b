"""SurfaceView: iso-surfaces of the exposures in space, A blue and B red; the camera stays when the shot changes."""

import math
from collections.abc import Sequence

from nicegui import ui

from processing.volume import VoxelGrid
from server.web.ui.results.seen_exposure import SeenExposure
from server.web.ui.results.slice_group import Dots, FreeSlider
from server.web.ui.scene_box import scene_box

_COLOURS = {"a": [0.35, 0.6, 1.0], "b": [1.0, 0.4, 0.3]}
_MOST_DOTS = 20_000


class SurfaceView:
    """Built once per page."""

    def __init__(self) -> None:
        self._seen: Sequence[SeenExposure] = ()
        self._grid: VoxelGrid | None = None
        self._dots: Dots = {}
        self._is_level_chosen = False
        self._scene = scene_box("iso-surface")
        with ui.row().classes("w-full items-center no-wrap gap-3"):
            self._label = ui.label("Iso level").classes("text-xs whitespace-nowrap")
            self._level = FreeSlider(min=0.01, max=0.99, step=0.01, value=0.3).props('dense aria-label="iso level"')
            self._level.on("change", self._choose_level)
            ui.button(icon="center_focus_strong", on_click=self._look_at_all).props(
                'flat dense round size=sm aria-label="see the whole volume"'
            )

    def show(self, seen: Sequence[SeenExposure]) -> None:
        """Show other exposures, by the level that was chosen, or by one that shows something."""
        self._seen = seen
        if not self._is_level_chosen:
            self._level.value = max(0.01, round(min(one.preview.telling_level for one in seen), 2))
        grid = seen[0].preview.grid
        is_elsewhere, self._grid = grid != self._grid, grid
        self._draw()
        if is_elsewhere:
            self._look_at_all()

    def mark(self, dots: Dots) -> None:
        """Show droplets as points."""
        is_nothing_new = not dots and not self._dots
        self._dots = dots
        if not is_nothing_new:
            self._draw()

    def _choose_level(self) -> None:
        self._is_level_chosen = True
        self._draw()

    def _draw(self) -> None:
        if self._grid is None:
            return
        level = float(self._level.value)
        brightest = max(one.preview.limit for one in self._seen)
        self._label.set_text(f"Iso level {level * brightest:.3g} ({100 * level:.0f} % of the brightest)")
        width, height, depth = (self._grid.shape[axis] * self._grid.pitch_mm for axis in (2, 1, 0))
        self._scene.clear()
        with self._scene:
            for one in self._seen:  # the mesh has y up; the scene has z up
                self._scene.gltf(f"{one.folder}/surface.glb?level={level:.2f}").rotate(math.pi / 2, 0, 0)
            box = self._scene.box(width, depth, height, wireframe=True).move(*_in_scene(_middle_mm(self._grid)))
            box.material("#6b7a8d", 0.35)
            for frame, points_mm in self._dots.items():
                if len(points_mm):
                    places = [list(_in_scene(place)) for place in points_mm[:_MOST_DOTS].tolist()]
                    size_mm = 0.012 * max(width, height, depth)
                    self._scene.point_cloud(places, [_COLOURS[frame]] * len(places), size_mm)

    def _look_at_all(self) -> None:
        if self._grid is None:
            return
        x, y, z = _in_scene(_middle_mm(self._grid))
        reach = 0.7 * max(self._grid.shape) * self._grid.pitch_mm
        self._scene.move_camera(x + reach, y - reach, z + 0.5 * reach, x, y, z, duration=0)


def _middle_mm(grid: VoxelGrid) -> tuple[float, float, float]:
    x_mm, y_mm, z_mm = (float(getattr(grid, f"{axis}_mm").mean()) for axis in "xyz")
    return x_mm, y_mm, z_mm


def _in_scene(place_mm: Sequence[float]) -> tuple[float, float, float]:
    """World to scene, which has z up."""
    x_mm, y_mm, z_mm = place_mm
    return x_mm, z_mm, -y_mm
