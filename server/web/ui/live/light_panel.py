"""LightPanel: pulses and currents beside the pictures; they are those of the run form, and the assistant sets them."""

import asyncio
import time
from collections.abc import Awaitable, Callable
from typing import Any

from nicegui import ui
from nicegui.events import GenericEventArguments

from daq.shot import Shot
from server.lab.live_view.light_assistant import Advice, SeenLight, advise, seen_light
from server.lab.services import Context
from server.web.ui.bar.age import age_text
from server.web.ui.bar.server_link import TICKET, shown_form
from server.web.ui.draft import PULSE_FIELDS, DraftStore, problem_of, problem_of_current
from server.web.ui.drag_slider import DragSlider
from server.web.ui.theme import panel
from server.web.ui.visiting import for_operators, why_not

_RELEASED = "(value) => emit({ ...(window.desk?.ticket() ?? {}), value })"
_STEP_A = 0.1
_KEPT = 6
"""Observations of one view that the assistant goes by."""
_NO_SHOT = "No shot to go by: show the rig live with pulsed light, or shoot one, then press again."


class LightPanel:
    """Built once per page.

    Parameters
    ----------
    context : Context
        The application.
    draft : DraftStore
        Knows pulses and currents, and keeps what is changed.
    apply : Callable[[GenericEventArguments], Awaitable[None]]
        Shows what has changed, if the rig is shown live; gets the click.
    """

    def __init__(
        self,
        context: Context,
        draft: DraftStore,
        apply: Callable[[GenericEventArguments], Awaitable[None]],
    ) -> None:
        self._context = context
        self._draft = draft
        self._apply = apply
        self._seen: dict[str, list[SeenLight]] = {view: [] for view in context.services.config.views}
        self._numbers: dict[str, ui.number] = {}
        self._times: dict[str, ui.number] = {}
        self._shown = draft.version
        self._sliders: dict[str, DragSlider] = {}
        with panel("Light"):
            with ui.row().classes("w-full no-wrap gap-2"):
                self._add_time("width_ns", "Pulse width / ns")
                self._add_time("separation_ns", "Separation / ns")
            for view in context.services.config.views:
                self._add_current(view)
            self._half = ui.button("Set to half range", icon="auto_fix_high")
            self._half.props("outline dense no-caps").classes("w-full").on("click", self._on_half, js_handler=TICKET)
            self._advice = ui.column().classes("w-full gap-0 text-xs").props('role=status aria-label="light assistant"')
        with self._advice:
            ui.label("Sets every LED so that its background has half of the range, by the newest shot.")

    def refresh(self) -> None:
        """Follow what other tabs change; nobody changes the light while somebody else holds control."""
        why = why_not(self._context)
        for field in (*self._times.values(), *self._numbers.values(), *self._sliders.values(), self._half):
            for_operators(field, why=why)
        if self._draft.version != self._shown:
            self._show()

    def _show(self) -> None:
        self._shown = self._draft.version
        for name, number in self._times.items():
            number.set_value(self._draft.values[name])
        for view, number in self._numbers.items():
            number.set_value(self._draft.values["current_a"].get(view))

    def _limit_a(self, view: str) -> float:
        return self._context.services.config.views[view].max_current_a

    def _add_time(self, name: str, label: str) -> None:
        number = ui.number(
            label,
            value=self._draft.values[name],
            precision=0,
            on_change=lambda event: self._keep(name, event.value),
            validation=lambda value: problem_of(PULSE_FIELDS, name, value),
        )
        number.props(f"dense outlined hide-bottom-space data-draft={name}").classes("flex-1 min-w-0")
        self._times[name] = number

    def _add_current(self, view: str) -> None:
        limit_a, value = self._limit_a(view), self._draft.values["current_a"].get(view)
        with ui.row().classes("w-full no-wrap items-center gap-3"):
            number = ui.number(
                f"LED {view} / A",
                value=value,
                on_change=lambda event: self._keep_current(view, event.value),
                validation=lambda value: problem_of_current(value, limit_a),
            )
            number.props(f'dense outlined hide-bottom-space data-draft="current_a:{view}"').classes("w-28")
            slider = DragSlider(value or 0.0, 0.0, limit_a, _STEP_A, lambda event: self._slid(view, event), _RELEASED)
            slider.props(f'dense aria-label="LED {view} current"').classes("flex-1 min-w-0")
            ui.label(f"max {limit_a:g} A").classes("text-xs opacity-70 whitespace-nowrap")
        self._numbers[view], self._sliders[view] = number, slider

    def _keep_current(self, view: str, value: float | None) -> None:
        self._sliders[view].set_value(value or 0.0)
        self._keep("current_a", {**self._draft.values["current_a"], view: value})

    def _keep(self, name: str, value: Any) -> None:
        if value != self._draft.values[name]:
            self._draft.set(name, value)

    async def _slid(self, view: str, event: GenericEventArguments) -> None:
        self._numbers[view].set_value(round(float(event.args["value"]), 2))
        await self._apply(event)

    async def _on_half(self, click: GenericEventArguments) -> None:
        self._draft.adopt(shown_form(click.args))
        shot = self._context.services.acquisition.newest_shot
        seen = {} if shot is None else await asyncio.to_thread(seen_light, shot, self._bits)
        self._advice.clear()
        with self._advice:
            ui.label(_NO_SHOT if shot is None else f"By shot {shot.index}, {age_text(_age_s(shot))} old:")
        for view, light in seen.items():
            self._seen[view] = [*self._seen[view], light][-_KEPT:]
            self._follow(view, advise(self._seen[view], self._limit_a(view)))
        if seen:
            await self._apply(click)

    def _follow(self, view: str, advice: Advice) -> None:
        with self._advice:
            ui.label(f"{view}: {advice.text}")
        if advice.current_a is not None:
            self._numbers[view].set_value(advice.current_a)

    @property
    def _bits(self) -> dict[str, int]:
        return {view: camera.bits for view, camera in self._context.services.rig.cameras.items()}


def _age_s(shot: Shot) -> float:
    return time.time() - shot.host_time_ns / 1e9
