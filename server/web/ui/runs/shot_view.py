"""ShotView: one shot of a run at a time, what is wrong with it, and its raw frames."""

import asyncio
from collections.abc import Callable
from datetime import datetime

from nicegui import ui

from daq.errors import ShotFileError
from daq.files.run_directory import RunReader, Shot
from daq.run_plan import ImageKey
from daq.shot import DoubleFrame
from server.lab.errors import NotFound
from server.lab.runs.shot_seen import fault_of, shot_of
from server.lab.services import Context
from server.web.ui.runs.shot_strip import next_invalid, strip_style
from server.web.ui.theme import panel

_WIDTH_PX = 640
_AT_ONCE = 8
"""Views whose frames are shown at most: as many as a run may have."""


class Scrubber(ui.slider):
    """A slider that the server does not pull back while it is being dragged; arrow keys move it by one."""

    LOOPBACK = False


class ShotView:
    """Built once per page.

    Parameters
    ----------
    context : Context
        The application.
    run_id : str
        Whose shots.
    shot : int
        The one that is shown first.
    on_shot : Callable[[int], None]
        Told which one is shown.
    """

    def __init__(self, context: Context, run_id: str, shot: int, on_shot: Callable[[int], None]) -> None:
        self._runs, self._run_id, self._on_shot = context.runs, run_id, on_shot
        self._valid: list[bool] = []
        self._shown, self._wanted = -1, shot
        with panel("Shots"):
            with ui.row().classes("w-full items-center no-wrap gap-3"):
                self._label = ui.label("").classes("text-sm font-medium whitespace-nowrap")
                self._label.props('role=status aria-label="shot shown"')
                self._fault = ui.label("").classes("refusal flex-1").props('role=status aria-label="fault of the shot"')
                self._next = ui.button("next invalid", on_click=self._jump).props("flat dense no-caps")
            self._strip = ui.element("div").classes("shot-strip").props('role=img aria-label="valid and invalid shots"')
            self._slider = Scrubber(min=0, max=1, value=0, on_change=self._move).props('dense aria-label="shot"')
            self._frames = ui.element("div").classes("frame-grid")

    async def reload(self) -> None:
        """Offer the shots that are there now."""
        keys = await asyncio.to_thread(self._runs.image_keys, self._run_id)
        self._valid = [key != ImageKey.INVALID for key in keys.tolist()]
        last = len(self._valid) - 1
        self._strip.style(strip_style(self._valid))
        self._slider.props(f"max={max(1, last)}")
        self._slider.set_visibility(last > 0)
        self._next.set_visibility(not all(self._valid))
        if last < 0:
            self._label.set_text("no shot is recorded")
        elif self._shown < 0:
            await self._show(max(0, min(self._wanted, last)))

    async def _move(self) -> None:
        await self._show(min(int(self._slider.value), len(self._valid) - 1))

    async def _jump(self) -> None:
        if (index := next_invalid(self._valid, self._shown)) is not None:
            await self._show(index)

    async def _show(self, index: int) -> None:
        if index == self._shown or index < 0:
            return
        self._shown = self._wanted = index
        self._slider.value = index
        self._on_shot(index)
        shot, fault = await asyncio.to_thread(self._read, index)
        if index == self._shown:  # nobody has gone on meanwhile
            self._tell(index, shot, fault)

    def _read(self, index: int) -> tuple[Shot | None, str]:
        try:
            shot = shot_of(RunReader(self._runs.directory(self._run_id)), index)
        except (ShotFileError, NotFound) as error:
            return None, str(error)
        return shot, fault_of(shot)

    def _tell(self, index: int, shot: Shot | None, fault: str) -> None:
        fired = "" if shot is None or not shot.host_time_ns else f" · fired {_clock(shot.host_time_ns)}"
        self._label.set_text(f"shot {index} ({index + 1} of {len(self._valid)}){fired}")
        self._fault.set_text(f"INVALID: {fault}" if fault else "")
        self._frames.clear()
        with self._frames:
            for view, frames in list(shot.views.items() if shot else ())[:_AT_ONCE]:
                self._pair(index, view, frames)

    def _pair(self, index: int, view: str, frames: DoubleFrame) -> None:
        exposures = (("a", frames.frame_a, frames.record_a), ("b", frames.frame_b, frames.record_b))
        with ui.element("figure").classes("frame-pair"):
            with ui.element("figcaption"):
                ui.label(view).classes("font-medium")
            for name, image, record in exposures:
                if image is None:
                    continue
                with ui.element("div"):
                    source = f"/api/runs/{self._run_id}/shots/{index}/{view}/{name}.png?width_px={_WIDTH_PX}"
                    picture = ui.element("img").props(f'loading=lazy alt="{view} exposure {name.upper()}"')
                    picture.props["src"] = source
                    flaw = "" if record.valid else " · missing"
                    ui.label(f"{name.upper()}{flaw}").classes("frame-note")


def _clock(host_time_ns: int) -> str:
    return f"{datetime.fromtimestamp(host_time_ns / 1e9).astimezone():%H:%M:%S.%f}"[:-3]
