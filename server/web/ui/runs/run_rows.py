"""What the list of runs says of a run. Pure."""

from collections.abc import Sequence
from datetime import datetime
from typing import Any

from daq.files.later_notes import NotesChange
from daq.run.state import RunOutcome
from daq.run_notes import RunNotes, Spray
from server.lab.runs.run_summary import ACTIVE, DAMAGED, PACKED, RunSummary
from server.web.ui.run.run_panel import outcome_colour

_CHANGES = 10


def run_row(run: RunSummary) -> dict[str, Any]:
    """One run in the table."""
    return {
        "id": run.run_id,
        "time": local_time(run.created_utc),
        "kind": run.kind or ("" if is_unreadable(run) else "imported"),
        "shots": shots_text(run),
        "outcome": run.outcome,
        "colour": run_colour(run),
        "cause": run.cause,
        "remedy": run.remedy,
        "calibration": run.calibration or "",
        "references": ", ".join(run.references),
        "notes": notes_text(run),
        "picture": f"/api/runs/{run.run_id}/thumbnail.jpg" if _has_picture(run) else "",
    }


def is_unreadable(run: RunSummary) -> bool:
    """Whether nothing can be made of it here."""
    return run.outcome in (DAMAGED, PACKED)


def _has_picture(run: RunSummary) -> bool:
    """Whether its first shot can be looked at, as far as the list knows."""
    return run.shots_recorded > 0 and not is_unreadable(run)


def shots_text(run: RunSummary) -> str:
    """Valid shots of those planned; of imported images and cut-off runs, of those that are there."""
    planned = run.shots_recorded if run.shots_planned is None else run.shots_planned
    if run.outcome == ACTIVE:
        return f"{run.shots_recorded} of {planned} so far"
    return "" if run.shots_valid is None else f"{run.shots_valid} / {planned}"


def run_colour(run: RunSummary) -> str:
    """Colour of its outcome: no run that lost a shot is green, and one without any is red."""
    if run.outcome != RunOutcome.COMPLETED:
        return outcome_colour(run.outcome)
    if not run.shots_valid:
        return "negative"
    return "positive" if run.shots_valid == run.shots_recorded else "warning"


def notes_text(run: RunSummary) -> str:
    """Its conditions in a line."""
    return _notes_line(run.notes)


def earlier_text(changes: Sequence[NotesChange]) -> str:
    """What stood in its notes before each change, the newest first."""
    told = [
        f"until {local_time(one.at_utc)}, when {one.who} changed it{_spray_told(one.spray)}: "
        f"{_notes_line(one.before) or 'nothing'}"
        for one in reversed(changes)
    ]
    return "\n".join([*told[:_CHANGES], *([f"and {len(told) - _CHANGES} before"] if len(told) > _CHANGES else [])])


def _spray_told(spray: Spray | None) -> str:
    if spray is None:
        return ""
    orifice, axis = (", ".join(f"{one:g}" for one in place) for place in (spray.nozzle_mm, spray.axis))
    return f" and put the orifice at {orifice} mm, the axis along {axis}"


def _notes_line(notes: RunNotes) -> str:
    """Conditions in a line."""
    pressure = "" if notes.pressure_bar is None else f"{notes.pressure_bar:g} bar"
    more = [f"{name}: {value}" for name, value in notes.more.items()]
    return " · ".join(
        text for text in (notes.operator, notes.fluid, notes.nozzle, pressure, notes.remark, *more) if text
    )


def changed_text(run: RunSummary) -> str:
    """Who changed its notes, and when; why that cannot be read."""
    if run.notes_flaw:
        return run.notes_flaw
    return f"changed by {run.notes_changed_by} at {local_time(run.notes_changed_utc)}" if run.notes_changed_utc else ""


def local_time(created_utc: str) -> str:
    """Date and time where the rig stands; what is no time stays as it is written."""
    try:
        return f"{datetime.fromisoformat(created_utc).astimezone():%Y-%m-%d %H:%M:%S}"
    except ValueError:
        return created_utc
