"""Draft: the run form as the operator left it, kept by the server, so that a reload or a restart loses nothing."""

import json
from pathlib import Path
from typing import Annotated, Any

from pydantic import TypeAdapter, ValidationError
from pydantic.fields import FieldInfo

from daq.run_plan import PulsePair, RunKind, RunPlan
from server.rig.config import RigConfig

PLAN_FIELDS = RunPlan.model_fields
PULSE_FIELDS = PulsePair.model_fields


def first_draft(config: RigConfig) -> dict[str, Any]:
    """Draft for a rig that has none yet."""
    return {
        "kind": RunKind.SAMPLE.value,
        "name": "spray",
        "shots": 10,
        "rate_hz": 2.0,
        "width_ns": 1000,
        "separation_ns": 6400,
        "stage_z_mm": "-4, -2, 0, 2, 4",
        "references": [],
        "calibration": None,
        "current_a": {name: view.nominal_current_a for name, view in config.views.items()},
    }


class DraftStore:
    """One draft per rig, in a JSON file beside the runs; small, and written only when something changed."""

    def __init__(self, path: Path, config: RigConfig) -> None:
        self._path = path
        self.values = first_draft(config)
        if path.is_file():
            self.values |= json.loads(path.read_text())

    def set(self, name: str, value: Any) -> None:
        """Remember a value of the form."""
        self.values[name] = value
        part = self._path.with_suffix(".part")
        part.write_text(json.dumps(self.values))
        part.replace(self._path)


def problem_of(fields: dict[str, FieldInfo], name: str, value: Any) -> str | None:
    """What is wrong with one value of a plan, by the limits of the plan itself; None if nothing is."""
    field = fields[name]
    try:
        adapter: TypeAdapter[Any] = TypeAdapter(Annotated[field.annotation, field])  # type: ignore[arg-type]
        adapter.validate_python(value)
    except ValidationError as error:
        return error.errors()[0]["msg"].removeprefix("Input should be ")
    return None


def problem_of_current(value: float | None, limit_a: float) -> str | None:
    """What is wrong with a current; None if nothing is."""
    return None if value is not None and 0 <= value <= limit_a else f"0 to {limit_a:g} A"


def problem_of_positions(text: str | None) -> str | None:
    """What is wrong with a list of stage positions; None if nothing is."""
    try:
        positions(text)
    except ValueError:
        return "numbers in mm, separated by commas"
    return None


def positions(text: str | None) -> tuple[float, ...]:
    """Stage positions of a list like ``-4, -2, 0``."""
    return tuple(float(part) for part in (text or "").split(",") if part.strip())


def plan_of(values: dict[str, Any]) -> RunPlan:
    """The plan that a draft describes.

    Raises
    ------
    ValueError
        It describes none.
    """
    kind = RunKind(values["kind"])
    return RunPlan(
        name=values["name"],
        kind=kind,
        shots=values["shots"],
        rate_hz=values["rate_hz"],
        pulse=PulsePair(
            width_ns=values["width_ns"], separation_ns=values["separation_ns"], current_a=values["current_a"]
        ),
        stage_z_mm=positions(values["stage_z_mm"]) if kind is RunKind.CALIBRATION else (),
        references=tuple(values["references"]) if kind is RunKind.SAMPLE else (),
        calibration=values["calibration"] if kind is RunKind.SAMPLE else None,
    )
