"""What the operator has written down of a run travels with what is measured of it, and who changed it when."""

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from daq.files.run_directory import NotesChange, RunConditions, RunNotes, RunReader, ShotFileError, Spray
from processing.analysis.droplets.droplet_file import StoredDroplets
from processing.analysis.spray.spray_axis import SprayAxis
from processing.analysis.stored_json import stored_json
from processing.runs.run_around import directory_around, run_around

CHANGED = "conditions_changed"
"""Of a file of droplets: who changed the conditions before it was measured, when, and what was recorded."""
REMEDY = "what is told of the spray is of the place that was stated when it was measured: measure it again"

Said = dict[str, Any]
ConditionsChanged = Annotated[
    tuple[str, ...], Field(description="what of notes, nozzle and axis was changed after the run: by whom and when")
]


def conditions_of(run: RunReader) -> dict[str, str]:
    """What holds of a run now, as far as it says anything of the spray."""
    now, header = run.conditions, run.header
    told = _told(now.notes, now.spray)
    if now.changed:
        recorded = _told(header.notes, header.spray)
        told[CHANGED] = json.dumps({"who": now.changed.who, "at_utc": now.changed.at_utc, "recorded": recorded})
    return told


def _told(notes: RunNotes, spray: Spray | None) -> dict[str, str]:
    texts = {"spray": spray.model_dump_json() if spray else "", "notes": notes.model_dump_json(exclude_defaults=True)}
    return {name: text for name, text in texts.items() if text not in ("", "{}")}


def axis_of(shots: Sequence[StoredDroplets], files: Sequence[Path]) -> SprayAxis | None:
    """As the files say; where they do not, as the run around them does: they are older, or it was stated later."""
    stated = next((told for shot in shots if (told := stored_json(shot.provenance, "spray"))), None)
    if stated:
        return SprayAxis(tuple(stated["nozzle_mm"]), tuple(stated["axis"]))
    spray = _spray_around(files[0])
    return SprayAxis(spray.nozzle_mm, spray.axis) if spray else None


def _spray_around(file: Path) -> Spray | None:
    """Nozzle and axis, as the run around a file says now; later notes that are damaged do not count."""
    header, run_dir = run_around(file), directory_around(file)
    if header is None or run_dir is None:
        return None
    try:
        return RunReader(run_dir).conditions.spray
    except ShotFileError:
        return header.spray


def changes_told(shots: Sequence[StoredDroplets], files: Sequence[Path]) -> tuple[str, ...]:
    """What of the conditions was changed after a run was recorded, and what after its droplets were measured."""
    alike = {
        (file.parent, *map(shot.provenance.get, ("run", "spray", "notes", CHANGED))): (shot.provenance, file)
        for shot, file in zip(shots, files, strict=True)
    }
    return tuple(dict.fromkeys(line for one in alike.values() for line in _of_shot(*one)))


def _of_shot(provenance: Mapping[str, Any], file: Path) -> Iterator[str]:
    name, measured = provenance.get("run", ""), _said(provenance)
    if changed := stored_json(provenance, CHANGED):
        differs = _differences(measured, _said(changed["recorded"]), "recorded")
        yield f"run {name} was changed by {changed['who']} at {changed['at_utc']}, after it was recorded: {differs}"
    run_dir = directory_around(file)
    if run_dir is None:
        return
    try:
        now = (run := RunReader(run_dir)).conditions
    except ShotFileError as error:
        yield f"whether run {name} was changed later is not known: {error}"
        return
    recorded = _said(_told(run.header.notes, run.header.spray))
    if now.changed:
        yield from _since(name, now, now.changed, measured if changed else recorded)


def _since(name: str, now: RunConditions, change: NotesChange, measured: Said) -> Iterator[str]:
    """What differs from what was measured with."""
    said = _said(_told(now.notes, now.spray))
    if said != measured:
        remedy = f"; {REMEDY}" if any(said.get(one) != measured.get(one) for one in Spray.model_fields) else ""
        differs = _differences(said, measured, "measured with")
        yield f"run {name} was changed by {change.who} at {change.at_utc}, after it was measured: {differs}{remedy}"


def _said(told: Mapping[str, Any]) -> Said:
    """Every condition under its name."""
    notes = stored_json(told, "notes")
    return {**stored_json(told, "spray"), **notes, **notes.pop("more", {})}


def _differences(now: Said, before: Said, was: str) -> str:
    differing = [name for name in {**before, **now} if now.get(name) != before.get(name)]
    told = [f"{name} is {_text(now.get(name))}, {was}: {_text(before.get(name))}" for name in differing]
    return "; ".join(told) or "and all is again as it was"


def _text(value: object) -> str:
    if isinstance(value, list):
        return f"({', '.join(f'{one:g}' for one in value)})"
    return "not stated" if value is None else str(value)
