"""FormFields: the inputs of the run form. Each shows its value of the draft, and keeps what is typed there."""

from collections.abc import Callable
from functools import partial
from typing import Any, TypeVar

from nicegui import ui

from daq.run_plan import RunKind
from server.lab.services import Context
from server.web.ui.draft import (
    NOTES_FIELDS,
    PLAN_FIELDS,
    PULSE_FIELDS,
    DraftStore,
    limits_of,
    problem_of,
    problem_of_current,
    problem_of_positions,
)
from server.web.ui.visiting import for_operators

_LOOK = "dense outlined hide-bottom-space"
_NOTES = (("operator", "Operator"), ("fluid", "Fluid"), ("nozzle", "Nozzle"))
Element = TypeVar("Element", ui.input, ui.number, ui.textarea)
Field = ui.input | ui.number | ui.toggle | ui.textarea


class FormFields:
    """Built once per page, in the place where it is created.

    Parameters
    ----------
    context : Context
        Knows views and limits.
    draft : DraftStore
        What the fields show, and where every change goes.
    changed : Callable[[], None]
        Called after each.
    """

    def __init__(self, context: Context, draft: DraftStore, changed: Callable[[], None]) -> None:
        self._context, self._draft, self._changed = context, draft, changed
        self._fields: dict[str, Field] = {}
        self._add_kind_and_name()
        with ui.grid(columns=2).classes("w-full gap-2"):
            self._shots = self._add_number("shots", "Shots", PLAN_FIELDS, whole=True)
            self._add_number("rate_hz", "Rate / Hz", PLAN_FIELDS)
            self._add_number("width_ns", "Pulse width / ns", PULSE_FIELDS, whole=True)
            self._add_number("separation_ns", "Separation / ns", PULSE_FIELDS, whole=True)
            for view in context.services.config.views:
                self._add_current(view)
        self._positions = self._add_text("stage_z_mm", "Target positions / mm", problem_of_positions)

    def add_notes(self) -> None:
        """Fields for what no device knows."""
        with ui.grid(columns=2).classes("w-full gap-2"):
            for name, label in _NOTES:
                self._add_text(name, label, partial(_problem_of_note, name))
            number = self._add("pressure_bar", ui.number("Pressure / bar", **self._bound("pressure_bar")))
            number.validation = lambda value: None if value is None or 0 <= value <= 10_000 else "0 to 10000 bar"
        self._add("remark", ui.textarea("Remark", **self._bound("remark")).props("autogrow")).classes("w-full")

    def show(self) -> None:
        """Show what another tab, or a template, has changed."""
        for name, field in self._fields.items():
            value = self._value(name)
            if field.value != value:
                field.set_value(value)

    def show_kind(self, kind: RunKind) -> None:
        """Only what a run of this kind needs is asked for."""
        moves = kind is RunKind.CALIBRATION and self._context.services.rig.stage is not None
        self._shots.set_label("Shots per position" if moves else "Shots")
        self._positions.set_visibility(moves)

    def allow(self, why: str) -> None:
        """Nobody types while somebody else holds control; why, where that is so."""
        for field in self._fields.values():
            for_operators(field, why=why)

    def are_good(self) -> bool:
        """Whether every value is within its limits; each field says what is wrong with it."""
        asked = [field for field in self._fields.values() if field.visible and not isinstance(field, ui.toggle)]
        return all([field.validate() for field in asked])

    def _add_kind_and_name(self) -> None:
        kinds = {kind.value: kind.value.capitalize() for kind in RunKind}
        toggle = ui.toggle(kinds, **self._bound("kind"))
        toggle.props('dense unelevated spread no-caps size=sm aria-label="Kind of run"').classes("w-full")
        self._fields["kind"] = toggle
        self._add_text(
            "name",
            "Name",
            lambda text: problem_of(PLAN_FIELDS, "name", text) and "1 to 80 letters, digits, space . _ -",
        )

    def _add_number(self, name: str, label: str, fields: dict[str, Any], *, whole: bool = False) -> ui.number:
        number = ui.number(label, precision=0 if whole else None, **self._bound(name))
        number.validation = lambda value: problem_of(fields, name, value)
        return self._add(name, number, limits_of(fields, name))

    def _add_current(self, view: str) -> None:
        limit_a = self._context.services.config.views[view].max_current_a
        number = ui.number(f"LED {view} / A", **self._bound(f"current_a:{view}"))
        number.validation = lambda value: problem_of_current(value, limit_a)
        self._add(f"current_a:{view}", number, f"0 to {limit_a:g}")

    def _add_text(self, name: str, label: str, problem: Callable[[str | None], str | None]) -> ui.input:
        text = ui.input(label, **self._bound(name))
        text.validation = problem
        return self._add(name, text).classes("w-full")

    def _add(self, name: str, field: Element, limits: str = "") -> Element:
        field.props(f'{_LOOK} data-draft="{name}"' + (f' hide-hint hint="{limits}"' if limits else ""))
        self._fields[name] = field
        return field

    def _bound(self, name: str) -> dict[str, Any]:
        return {"value": self._value(name), "on_change": lambda event: self._keep(name, event.value)}

    def _value(self, name: str) -> Any:
        field, _, view = name.partition(":")
        value = self._draft.values[field]
        return value.get(view) if view else value

    def _keep(self, name: str, value: Any) -> None:
        field, _, view = name.partition(":")
        if value == self._value(name):
            return
        self._draft.set(field, {**self._draft.values[field], view: value} if view else value)
        self._changed()
        if name == "kind":
            self.show()  # it may have brought a name with it


def _problem_of_note(name: str, text: str | None) -> str | None:
    return problem_of(NOTES_FIELDS, name, text or "")
