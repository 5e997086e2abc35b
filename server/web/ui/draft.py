"""Draft: the run form as the operator left it, one for all tabs, kept by the server: no reload or restart loses it."""

import json
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, TypeAdapter, ValidationError
from pydantic.fields import FieldInfo

from daq.recipe import Recipe
from daq.run_notes import RunNotes
from daq.run_plan import PulsePair, RunKind, RunPlan
from processing.reconstruction.choices import ReconstructionMethod
from server.lab.damage import set_aside
from server.lab.events import EventPublisher
from server.rig.config import RigConfig

PLAN_FIELDS = RunPlan.model_fields
PULSE_FIELDS = PulsePair.model_fields


NOTES_FIELDS = RunNotes.model_fields
NO_VOLUMES = "none"
USUAL_NAMES = {
    RunKind.SAMPLE: "spray",
    RunKind.BACKGROUND: "background",
    RunKind.DARK: "dark",
    RunKind.CALIBRATION: "target",
}
"""Names that nobody has thought of: they follow the kind of a run."""
USUAL_SHOTS = {RunKind.SAMPLE: 10, RunKind.BACKGROUND: 20, RunKind.DARK: 10, RunKind.CALIBRATION: 1}
"""So do numbers of shots; of a calibration per position."""

_TEXTS = ("name", "stage_z_mm", "droplet_box", "operator", "fluid", "nozzle", "remark")


def first_draft(config: RigConfig) -> dict[str, Any]:
    """Draft for a rig that has none yet."""
    return {
        "kind": RunKind.SAMPLE.value,
        "name": USUAL_NAMES[RunKind.SAMPLE],
        "shots": USUAL_SHOTS[RunKind.SAMPLE],
        "rate_hz": 2.0,
        "width_ns": 1000,
        "separation_ns": 6400,
        "stage_z_mm": "-4, -2, 0, 2, 4",
        "references": [],
        "are_references_chosen": False,
        "calibration": None,
        "volumes": ReconstructionMethod.MLOS.value,
        "droplets": False,
        "droplet_box": "",
        "operator": "",
        "fluid": "",
        "nozzle": "",
        "pressure_bar": None,
        "remark": "",
        "current_a": {name: view.nominal_current_a for name, view in config.views.items()},
    }


class StoredDraft(BaseModel):
    """What may stand in the file of a draft: a field that the operator has left empty is null."""

    kind: RunKind = RunKind.SAMPLE
    name: str | None = None
    shots: float | None = None
    rate_hz: float | None = None
    width_ns: float | None = None
    separation_ns: float | None = None
    stage_z_mm: str | None = None
    references: list[str] = []
    are_references_chosen: bool = False
    calibration: str | None = None
    volumes: ReconstructionMethod | Literal["none"] = ReconstructionMethod.MLOS
    droplets: bool = False
    droplet_box: str | None = None
    operator: str | None = None
    fluid: str | None = None
    nozzle: str | None = None
    pressure_bar: float | None = None
    remark: str | None = None
    current_a: dict[str, float | None] = {}


class DraftStore:
    """One draft per rig, in a JSON file beside the runs; small, and written only when something changed.

    Parameters
    ----------
    path : Path
        The file. One that cannot be read is set aside, and the first draft is shown.
    config : RigConfig
        Of the rig.
    events : EventPublisher
        Told of a damaged file.
    may_change : Callable[[], bool]
        Asked before every change whether he may who asks for it: pages lock what he may not, and sockets do not.
    has_stage : bool
        Whether the rig has one.
    """

    def __init__(
        self,
        path: Path,
        config: RigConfig,
        events: EventPublisher,
        may_change: Callable[[], bool] = lambda: True,
        *,
        has_stage: bool = True,
    ) -> None:
        self._may_change = may_change
        self._path = path
        self._events = events
        self._has_stage = has_stage
        self.values = first_draft(config) | self._stored()
        first, stored = first_draft(config)["current_a"], self.values["current_a"]
        self.values["current_a"] = {view: stored.get(view, current_a) for view, current_a in first.items()}
        self._unkept: dict[str, Any] = {}
        self.version = 0
        """Grows with every change, so that other tabs see that there was one."""

    def set(self, name: str, value: Any) -> None:
        """Remember a value of the form, from whoever may change it.

        What another program has changed meanwhile stays as it is in the file.
        """
        if not self._may_change():
            return
        if name == "kind":
            self._follow_kind(RunKind(self.values["kind"]), RunKind(value))
        self.values[name] = value
        self.version += 1
        self._unkept[name] = value
        with suppress(OSError):  # the bar tells of a disk that is full, or gone; it gets all with the next change
            self._keep()

    def _keep(self) -> None:
        part = self._path.with_suffix(".part")
        part.write_text(json.dumps({**self._stored(), **self._unkept}))
        part.replace(self._path)
        self._unkept.clear()

    @property
    def plan(self) -> RunPlan:
        """What the form describes for this rig; ValueError if that is no plan."""
        return plan_of(self.values, self._has_stage)

    def adopt(self, shown: Mapping[str, str]) -> None:
        """Take over what the page shows, by ``data-draft``: the last letters may have been lost in a network.

        A number that is none is left empty, as the page would.
        """
        for name, text in shown.items():
            field, _, view = name.partition(":")
            value = text if field in _TEXTS else _number(text)
            new = {**self.values[field], view: value} if view else value
            if new != self.values[field]:
                self.set(field, new)

    def _follow_kind(self, before: RunKind, now: RunKind) -> None:
        """Nobody has thought of what is usual for the kind before."""
        for name, usual in (("name", USUAL_NAMES), ("shots", USUAL_SHOTS)):
            if self.values[name] == usual[before]:
                self.set(name, usual[now])

    def _stored(self) -> dict[str, Any]:
        if not self._path.is_file():
            return {}
        try:
            stored = StoredDraft.model_validate_json(self._path.read_bytes())
        except (OSError, ValidationError) as error:
            set_aside(self._path, f"draft of a run: {error}", self._events)
            return {}
        values = stored.model_dump(mode="json", exclude_unset=True)
        values.setdefault("are_references_chosen", bool(stored.references))  # an older draft does not say
        return values


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None


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
        is_any = bool(positions(text))
    except ValueError:
        is_any = False
    return None if is_any else "numbers in mm, separated by commas"


def positions(text: str | None) -> tuple[float, ...]:
    """Stage positions of a list like ``-4, -2, 0``."""
    return tuple(float(part) for part in (text or "").split(",") if part.strip())


def notes_of(values: dict[str, Any]) -> RunNotes:
    """What no device knows; ValueError if it is too long."""
    texts = {name: values.get(name) or "" for name in ("operator", "fluid", "nozzle", "remark")}
    return RunNotes.model_validate({**texts, "pressure_bar": values.get("pressure_bar")})


def limits_of(fields: dict[str, FieldInfo], name: str) -> str:
    """The limits of a number, by the plan itself."""
    limits = {
        key: getattr(one, key) for one in fields[name].metadata for key in ("ge", "gt", "le") if hasattr(one, key)
    }
    low = f"above {limits['gt']:g}" if "gt" in limits else f"{limits['ge']:g}"
    return f"{low} to {limits['le']:g}"


def pulse_of(values: dict[str, Any]) -> PulsePair:
    """The light that a draft describes; ValueError if it describes none."""
    return PulsePair(width_ns=values["width_ns"], separation_ns=values["separation_ns"], current_a=values["current_a"])


def _recipes_of(values: dict[str, Any]) -> tuple[Recipe, ...]:
    """What is made of every shot by itself."""
    volumes = Recipe(command="reconstruct", settings={"method": values["volumes"]})
    box = (values["droplet_box"] or "").strip()
    droplets = Recipe(command="measure", settings={"grid": box} if box else {})
    chosen = (values["volumes"] != NO_VOLUMES and volumes, values["droplets"] and droplets)
    return tuple(recipe for recipe in chosen if recipe)


def plan_of(values: dict[str, Any], has_stage: bool = True) -> RunPlan:
    """The plan that a draft describes; only a rig with a stage moves the target, and has to know where to.

    Raises
    ------
    ValueError
        It describes none.
    """
    kind = RunKind(values["kind"])
    moves = kind is RunKind.CALIBRATION and has_stage
    if moves and problem_of_positions(values["stage_z_mm"]):
        raise ValueError("stage_z_mm: no positions of the target")
    return RunPlan(
        name=values["name"],
        kind=kind,
        shots=values["shots"],
        rate_hz=values["rate_hz"],
        pulse=pulse_of(values),
        notes=notes_of(values),
        stage_z_mm=positions(values["stage_z_mm"]) if moves else (),
        references=tuple(values["references"]) if kind is RunKind.SAMPLE else (),
        calibration=values["calibration"] if kind is RunKind.SAMPLE else None,
        recipes=_recipes_of(values) if kind is RunKind.SAMPLE else None,
    )
