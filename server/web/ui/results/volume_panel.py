"""VolumePanel: one volume, as a slice across each axis and as an iso-surface in space. Pictures come by URL."""

import asyncio
import math
from pathlib import Path

from nicegui import ui

from processing.volume import VoxelGrid
from server.lab.errors import ServerError
from server.lab.jobs import Job, JobKind, JobState
from server.lab.results import preview_of, volume_file
from server.lab.services import Context
from server.pictures.previews import AXES
from server.web.ui.theme import panel

_SHOWN = 60
_PICTURES = ("z", "y", "x")


class FreeSlider(ui.slider):
    """A slider that the server does not pull back while it is being dragged."""

    LOOPBACK = False


class SlicePicture:
    """A slice across one axis, with its slider."""

    def __init__(self, axis: str) -> None:
        self._axis = axis
        self._folder = ""
        with ui.column().classes("gap-0 min-w-0"):
            self._label = ui.label(f"{axis} = -").classes("text-xs opacity-80").props("role=status")
            self._image = (
                ui.interactive_image(cross=False).classes("slice").props(f'role=img aria-label="slice {axis}"')
            )
            self._slider = FreeSlider(min=0, max=1, value=0, on_change=self._move)
            self._slider.props(f'dense aria-label="slice {axis}"')

    def show(self, folder: str, grid: VoxelGrid) -> None:
        """Show another volume, from its middle."""
        self._folder, self._positions_mm = folder, getattr(grid, f"{self._axis}_mm")
        planes = grid.shape[AXES.index(self._axis)]
        self._slider.props(f"max={planes - 1}")
        self._slider.value = planes // 2
        self._move()

    def _move(self) -> None:
        if self._folder:
            index = min(int(self._slider.value), len(self._positions_mm) - 1)
            self._label.set_text(f"{self._axis} = {self._positions_mm[index]:.2f} mm")
            self._image.set_source(f"{self._folder}/slices/{self._axis}/{index}.png")


class VolumePanel:
    """Built once per page; follows the newest volume until the operator chooses one."""

    def __init__(self, context: Context) -> None:
        self._context = context
        self._folder = self._newest = ""
        with panel("Volume", "flex-1 no-wrap"):
            with ui.row().classes("w-full items-center no-wrap gap-3"):
                self._choice = ui.select({}, label="Volume", on_change=self._on_choice)
                self._choice.props("dense outlined options-dense").classes("flex-1 min-w-0")
                self._follow = ui.switch("newest", value=True, on_change=self._on_follow).props("dense")
                self._download = ui.button(icon="download").props(
                    'flat dense round type=a aria-label="download volume"'
                )
            with ui.grid(columns=3).classes("w-full gap-2"):
                self._slices = [SlicePicture(axis) for axis in _PICTURES]
            self._scene = ui.scene(grid=False, background_color="#0b0f14", fps=15).classes("scene-box")
            self._scene.props('role=img aria-label="iso-surface"')
            with ui.row().classes("w-full items-center no-wrap gap-3"):
                ui.label("Iso level").classes("text-xs opacity-80 whitespace-nowrap")
                self._level = FreeSlider(min=0.05, max=0.95, step=0.05, value=0.3).props('dense aria-label="iso level"')
                self._level.on("change", self._draw_surface)

    async def reload(self) -> None:
        """Offer the volumes that exist now."""
        jobs = await asyncio.to_thread(self._context.jobs.newest, None, [JobState.DONE], _SHOWN)
        options = {path: label for job in jobs for path, label in _volumes_of(job)}
        if not options:
            return
        self._newest, shown = next(iter(options)), self._choice.value
        if shown and shown not in options:
            options[shown] = self._choice.options[shown]
        self._choice.set_options(options, value=self._newest if self._follow.value else shown)

    def _on_follow(self) -> None:
        if self._follow.value and self._newest:
            self._choice.value = self._newest

    async def _on_choice(self) -> None:
        path = self._choice.value
        if not path or path == self._folder:
            return
        if path != self._newest:
            self._follow.value = False
        run_id, results_id, name = path.split("/")
        try:
            preview = await asyncio.to_thread(self._preview, run_id, results_id, name)
        except ServerError as error:
            ui.notify(str(error), type="negative")
            return
        self._folder, self._grid = path, preview
        folder = f"/api/runs/{run_id}/results/{results_id}/{name}"
        for view in self._slices:
            view.show(folder, preview)
        self._download.props(f'href="{folder}/volume.vtkhdf"')
        self._draw_surface()

    def _preview(self, run_id: str, results_id: str, name: str) -> VoxelGrid:
        return preview_of(volume_file(self._context.runs.directory(run_id), results_id, name)).grid

    def _draw_surface(self) -> None:
        if not self._folder:
            return
        run_id, results_id, name = self._folder.split("/")
        width, height, depth = (self._grid.shape[axis] * self._grid.pitch_mm for axis in (2, 1, 0))
        x_mm, y_mm, z_mm = (float(getattr(self._grid, f"{axis}_mm").mean()) for axis in "xyz")
        self._scene.clear()
        with self._scene:
            # The mesh has y up; the scene has z up.
            url = f"/api/runs/{run_id}/results/{results_id}/{name}/surface.glb?level={self._level.value:.2f}"
            self._scene.gltf(url).rotate(math.pi / 2, 0, 0)
            self._scene.box(width, depth, height, wireframe=True).move(x_mm, z_mm, -y_mm).material("#6b7a8d", 0.35)
        reach = 0.8 * max(width, height, depth)
        self._scene.move_camera(x_mm + reach, z_mm - reach, -y_mm + 0.5 * reach, x_mm, z_mm, -y_mm, duration=0)


def _volumes_of(job: Job) -> list[tuple[str, str]]:
    """Path and label of the volumes of a finished reconstruction."""
    if job.kind is not JobKind.RECONSTRUCTION or job.shot is None:
        return []
    written = (job.result or {}).get("volumes") or [{"file": f"shot_{job.shot:05d}_a.vtkhdf", "frame": "a"}]
    method = str(job.settings.get("method", "")).upper()
    return [
        (
            f"{job.run_id}/{job.results_id}/{Path(item['file']).stem}",
            f"shot {job.shot} {item['frame'].upper()} · {method} · {job.run_id}",
        )
        for item in written
    ]
