"""RunPanel: what the run is doing, and the button that ends it after the present shot; ABORT is in the header."""

import time
from collections.abc import Callable, Sequence

from nicegui import ui

from daq.counted import counted
from daq.errors import DaqError
from daq.run.events import RunStatus
from daq.run.state import RunState
from daq.run_plan import RunKind
from server.lab.desk.rig_state import minutes
from server.lab.duty import Health, Lamp
from server.lab.errors import ServerError
from server.lab.recipes.stated import told_recipes
from server.lab.services import Context
from server.lab.starting.command import tell_deed
from server.web.api.at_once import at_once
from server.web.ui.run.shot_strip import ShotStrip
from server.web.ui.theme import panel
from server.web.ui.visiting import for_operators, require_operator, told

_LIVE = "live view"
_NO_RUN = "no run since the server was started"


class RunPanel:
    """Built once per page, refreshed by its timer."""

    def __init__(self, context: Context) -> None:
        self._context = context
        self._acquisition = context.services.acquisition
        self._monitor = context.monitor
        with panel("Run"):
            with ui.row().classes("w-full items-baseline justify-between no-wrap"):
                self._name = ui.label(_NO_RUN).classes("text-base font-medium ellipsis")
                self._outcome = ui.badge("").props('aria-label="run outcome"')
            self._bar = ui.linear_progress(0, show_value=False, size="10px").props(
                'rounded instant-feedback aria-label="run progress"'
            )
            self._strip = ShotStrip(context.services.events)
            self._counts = ui.label("").classes("text-sm").props('role=status aria-label="run counts"')
            self._waits = ui.label("").classes("text-xs run-line").props('role=status aria-label="waits for"')
            self._message = (
                ui.label("").classes("text-xs opacity-70 run-line").props('role=status aria-label="run message"')
            )
            self._made = ui.label("").classes("text-xs opacity-70").props('role=status aria-label="made by itself"')
            self._stop = ui.button("Stop", icon="stop", on_click=self._on_stop).props("outline")
            self._stop.tooltip("Ends the run after the present shot")
            self._acknowledge = ui.button("Acknowledge fault", icon="verified_user", on_click=self._on_acknowledge)
            self._acknowledge.props("outline no-caps color=negative")

    def refresh(self) -> None:
        """Show the present state."""
        status = self._acquisition.status()
        self._name.set_text(status.run_id or _NO_RUN)
        self._bar.set_value(status.shots_recorded / max(1, status.shots_planned))
        self._strip.refresh(status.run_id)
        self._counts.set_text(counts_text(status, self._context.desk.state.eta_s))
        self._waits.set_text(_waiting_text(status, time.monotonic()))
        self._message.set_text(message_text(status))
        self._made.set_text(_made_text(status))
        self._outcome.set_text(status.outcome.value if status.outcome else "active" if status.active else "")
        self._outcome.props(f"color={outcome_colour(status.outcome)}")
        self._outcome.set_visibility(bool(self._outcome.text))
        for_operators(self._stop, status.active)
        self._acknowledge.set_text(acknowledge_text(status))
        for_operators(self._acknowledge).set_visibility(waits_for_acknowledgement(status, self._monitor.lamps))

    async def _on_stop(self) -> None:
        await self._command(self._acquisition.stop, "stopped the run")

    async def _on_acknowledge(self) -> None:
        await self._command(self._acquisition.acknowledge, "acknowledged a fault")

    async def _command(self, command: Callable[[], None], deed: str) -> None:
        """Give a command to acquisition, and say if it failed."""
        try:
            who = require_operator()
            await at_once(command)
            tell_deed(self._context, who, deed)
        except (DaqError, ServerError) as error:
            ui.notify(told(error), type="negative")


def waits_for_acknowledgement(status: RunStatus, lamps: Sequence[Lamp]) -> bool:
    """True where an operator must clear a fault: of acquisition, or latched by a generator that is at rest."""
    latched = any(lamp.kind == "generator" and lamp.health is Health.FAULT for lamp in lamps)
    return status.state is RunState.FAULT or bool(status.to_acknowledge) or (latched and status.resting)


def acknowledge_text(status: RunStatus) -> str:
    """What the button says: of several causes the one that comes next, so that none hides another."""
    waiting = status.to_acknowledge
    return f"Acknowledge 1 of {len(waiting)}: {waiting[0].text}" if waiting else "Acknowledge fault"


def _waiting_text(status: RunStatus, now_s: float) -> str:
    """What the run waits for, and since when; nothing where it does not wait."""
    waiting = status.waiting
    return f"waits for {waiting.text}, {max(0.0, now_s - waiting.since_s):.1f} s" if waiting and status.active else ""


def counts_text(status: RunStatus, eta_s: float | None = None) -> str:
    """Shots in words; nothing before the first run: whether the rig is ready, the bar says."""
    if status.run_id is None:
        return ""
    invalid = status.shots_recorded - status.shots_valid
    text = f"{status.shots_recorded} / {counted(status.shots_planned, 'shot')} recorded, {status.shots_valid} valid"
    text = f"{text}, {invalid} INVALID" if invalid else text
    return text if eta_s is None else f"{text}; {minutes(eta_s)} left"


def message_text(status: RunStatus) -> str:
    """What happened last; nothing where that is what the counts say. Of a live view, or of its end, this says so."""
    if status.live is not None or (status.causes and not status.ended_run):
        return status.message if status.message.startswith(_LIVE) else f"{_LIVE}: {status.message}"
    return "" if status.message == status.summary else status.message


def _made_text(status: RunStatus) -> str:
    """What is made of the shots of a spray by itself, as the plan of their run states it."""
    is_of_spray = status.run_id and status.plan and status.plan.kind is RunKind.SAMPLE
    if not is_of_spray or status.plan is None:
        return ""
    made = status.plan.recipes if status.plan.calibration else ()
    return f"Of every shot: {told_recipes(made or ())}"


def outcome_colour(outcome: str | None) -> str:
    """Colour of an outcome or a job state: what went well, what an operator ended, what went wrong."""
    return {
        "completed": "positive",
        "done": "positive",
        "stopped": "blue-grey-7",
        "aborted": "warning",
        "interrupted": "warning",
        "failed": "negative",
        "damaged": "negative",
    }.get(outcome or "", "primary")
