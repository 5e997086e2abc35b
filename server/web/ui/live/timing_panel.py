"""TimingPanel: where the pulses of the form lie in the exposures, or why they cannot; follows every change."""

import asyncio
from collections.abc import Mapping
from typing import Any

from nicegui import ui

from daq.errors import DaqError
from daq.run.preflight import permitted_timing
from daq.run_plan import RunPlan
from server.lab.desk.reason import refusal_text
from server.lab.services import Context
from server.pictures.timing_sketch import timing_sketch
from server.web.ui.draft import DraftStore, pulse_of
from server.web.ui.theme import panel

_FIELDS = ("width_ns", "separation_ns", "current_a")


class TimingPanel:
    """Built once per page, refreshed by its timer."""

    def __init__(self, context: Context, draft: DraftStore) -> None:
        self._rig = context.services.rig
        self._draft = draft
        self._drawn: dict[str, Any] = {}
        with panel("Timing"):
            self._sketch = ui.html("", sanitize=False).classes("w-full timing")
            self._problem = ui.label("").classes("refusal").props('role=alert aria-label="timing problem"')
            link = ui.link("All edges of the shot", new_tab=True).classes("text-xs")
            self._link = link.tooltip("Camera triggers, exposures and pulses at the nominal currents, in a new tab")

    async def refresh(self) -> None:
        """Draw again what has changed."""
        wanted = {name: self._draft.values[name] for name in _FIELDS}
        if wanted == self._drawn:
            return
        self._drawn = wanted
        sketch, problem = await asyncio.to_thread(self._draw, wanted)
        self._problem.set_text(problem)
        self._problem.set_visibility(bool(problem))
        self._sketch.set_content(sketch)
        self._link.set_visibility(not problem)
        width_ns, separation_ns = wanted["width_ns"], wanted["separation_ns"]
        self._link.props(f'href="/api/rig/timing.svg?width_ns={width_ns}&separation_ns={separation_ns}"')

    def _draw(self, wanted: Mapping[str, Any]) -> tuple[str, str]:
        """Sketch, and what is wrong."""
        try:
            plan = RunPlan(name="timing", shots=1, rate_hz=0.1, pulse=pulse_of(dict(wanted)))
            return timing_sketch(permitted_timing(self._rig, plan)), ""
        except DaqError as error:
            return "", refusal_text(error)
        except ValueError:
            return "", "a field of the light above is empty or out of range"
