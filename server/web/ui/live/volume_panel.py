"""LiveVolumePanel: the newest shot as slices and iso-surface, while the operator wants to see it."""

import math
import time

from nicegui import ui
from nicegui.element import Element
from nicegui.elements.scene import Object3D

from processing.volume import VoxelGrid
from server.lab.services import Context
from server.web.api.live_volume import VOLUME_PATH
from server.web.ui.scene_box import scene_box
from server.web.ui.theme import panel

_LEVEL = 0.3
_REDRAW_S = 0.4
"""Two a second, as the page looks four times a second."""
_SHOWN = 2
"""The last surface stays until the browser has the next one."""
_HINT = "Off: costs nothing. On: each new shot of the live view becomes a volume, by the current calibration."


class LiveSlices(Element, component="live_volume.js"):
    """Three slices that are linked."""

    def __init__(self) -> None:
        super().__init__()
        self.classes("w-full")
        self._props["path"] = VOLUME_PATH


class LiveVolumePanel:
    """Built once per page; its pictures are made while its switches are on."""

    def __init__(self, context: Context) -> None:
        self._volume = context.live_volume
        self._drawn = 0
        self._drawn_s = 0.0
        self._meshes: list[Object3D] = []
        self._scene: ui.scene | None = None
        with panel("Live volume"):
            with ui.row().classes("w-full items-center gap-4"):
                self._wanted = ui.switch("Slices", on_change=self._rebuild).props('aria-label="live slices"')
                self._surface = ui.switch("Iso-surface", on_change=self._rebuild).props('aria-label="live iso-surface"')
                self._hint = ui.label(_HINT).classes("text-xs opacity-70 flex-1")
            self._box = ui.column().classes("w-full")

    def refresh(self) -> None:
        """Draw the surface of a volume that is new; whoever looks at the slices has it made."""
        if self._scene is None:
            return
        view = self._volume.view
        if view.number == self._drawn or time.monotonic() - self._drawn_s < _REDRAW_S:
            return
        if view.shape is None or view.origin_mm is None or view.pitch_mm is None:
            return
        grid = VoxelGrid(view.shape, view.origin_mm, view.pitch_mm)
        if not self._drawn:
            self._look_at(grid)
        self._drawn, self._drawn_s = view.number, time.monotonic()
        with self._scene:
            mesh = self._scene.gltf(f"{VOLUME_PATH}/surface.glb?level={_LEVEL}")
        self._meshes.append(mesh.rotate(math.pi / 2, 0, 0))  # the mesh has y up; the scene has z up
        while len(self._meshes) > _SHOWN:
            self._meshes.pop(0).delete()

    def _rebuild(self) -> None:
        self._box.clear()
        self._scene, self._drawn, self._meshes = None, 0, []
        self._hint.set_visibility(not (self._wanted.value or self._surface.value))
        with self._box:
            if self._wanted.value or self._surface.value:
                LiveSlices()
            if self._surface.value:
                self._scene = scene_box("live iso-surface")

    def _look_at(self, grid: VoxelGrid) -> None:
        assert self._scene is not None  # noqa: S101 - asked by refresh
        x_mm, y_mm, z_mm = (float(getattr(grid, f"{axis}_mm").mean()) for axis in "xyz")
        reach = 0.8 * grid.pitch_mm * max(grid.shape)
        self._scene.move_camera(x_mm + reach, z_mm - reach, -y_mm + 0.5 * reach, x_mm, z_mm, -y_mm, duration=0)
