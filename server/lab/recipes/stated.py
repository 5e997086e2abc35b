"""Recipes of a plan: spelled out with all their settings and their hash, so that the run says what is made of it."""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path

from pydantic import JsonValue, ValidationError

from daq.files.header import RunHeader
from daq.recipe import Recipe
from daq.run.refusals import RefusalCode
from daq.run_plan import RunKind, RunPlan
from processing.calibration.calibration_file import load_calibration
from processing.errors import BadInput
from processing.reconstruction.settings import METHOD_VERSION as VOLUME_VERSION
from processing.reconstruction.settings import FrozenValue, GridSettings, ReconstructionSettings
from processing.runs.droplets.measure_settings import METHOD_VERSION as DROPLET_VERSION
from processing.runs.droplets.measure_settings import MeasureSettings, require_measurable
from processing.runs.recipe import recipe_sha256
from processing.runs.stated_grid import parse_grid
from server.lab.errors import NotFound, Unprocessable
from server.lab.runs.run_store import RunStore

_POLARITY = RunHeader.model_fields["polarity"].default
"""Of what cameras of a rig record."""
_COMMANDS: Mapping[str, tuple[type[FrozenValue], int, Mapping[str, str]]] = {
    "reconstruct": (ReconstructionSettings, VOLUME_VERSION, {}),
    "measure": (MeasureSettings, DROPLET_VERSION, {"polarity": _POLARITY}),
}
"""Settings, version of the method, and what is said by what the run is."""


def usual_recipe(settings: ReconstructionSettings) -> Recipe:
    """What is made where a plan states nothing: volumes."""
    return spelled_out(Recipe(command="reconstruct", settings=settings.model_dump(mode="json")))


def spelled_out(recipe: Recipe, calibration: Path | None = None) -> Recipe:
    """The same with every setting and the hash; a grid may be stated as with ``--grid``, and a calibration's pixels.

    Raises
    ------
    Unprocessable
        A setting is misspelt or wrong, or the hash is that of other settings, or of another version of the method.
    """
    settings = settings_of(_with_voxels(recipe, calibration))
    version = _COMMANDS[recipe.command][1]
    sha256 = recipe_sha256(recipe.command, version, settings)
    if recipe.sha256 not in ("", sha256):
        raise _wrong(recipe, f"sha256 is {recipe.sha256}, and what it states has {sha256}; leave it out, or correct it")
    return Recipe(command=recipe.command, settings=settings.model_dump(mode="json"), sha256=sha256)


def settings_of(recipe: Recipe) -> FrozenValue:
    """What a recipe states, as a value; Unprocessable if it is none."""
    kind, _, said = _COMMANDS[recipe.command]
    try:
        settings = kind.model_validate_json(json.dumps({**said, **recipe.settings}), strict=True)
        if isinstance(settings, MeasureSettings):
            require_measurable("this run", _POLARITY, settings)
    except ValidationError as error:
        first = error.errors()[0]
        raise _wrong(recipe, f"{'.'.join(map(str, first['loc']))}: {first['msg']}") from error
    except BadInput as error:
        raise _wrong(recipe, str(error)) from error
    return settings


def _with_voxels(recipe: Recipe, calibration: Path | None) -> Recipe:
    box = recipe.settings.get("grid")
    if not isinstance(box, str):
        return recipe
    if calibration is None:
        raise _wrong(recipe, f"box {box!r}: its voxels are those of a calibration, and none is chosen")
    try:
        grid = GridSettings.of(parse_grid(box.strip(), load_calibration(calibration), "box"))
    except (BadInput, OSError) as error:
        raise _wrong(recipe, str(error)) from error
    return recipe.model_copy(update={"settings": {**recipe.settings, "grid": grid.model_dump(mode="json")}})


def with_recipes(plan: RunPlan, usual: Recipe, calibration: Path | None = None) -> RunPlan:
    """A sample run states what is made of it; recipes that cannot be followed stay as they are, and are refused."""
    if plan.kind is not RunKind.SAMPLE:
        return plan
    stated = (usual,) if plan.recipes is None else plan.recipes
    try:
        return plan.model_copy(update={"recipes": tuple(spelled_out(one, calibration) for one in stated)})
    except Unprocessable:
        return plan


def against_recipes(runs: RunStore, plan: RunPlan, calibration: Path | None = None) -> Iterator[Unprocessable]:
    """Why what a plan states cannot be made of its shots."""
    for recipe in plan.recipes or ():
        try:
            spelled_out(recipe, calibration)
        except Unprocessable as error:
            yield error
    if plan.recipes and plan.kind is not RunKind.SAMPLE:
        yield Unprocessable(f"recipes: nothing is made of a {plan.kind} run by itself", RefusalCode.RECIPE)
    elif _measures(plan) and not any(_is_background(runs, run_id) for run_id in plan.references):
        reason = "recipes: droplets are measured against a background run, and none is among the references"
        yield Unprocessable(reason, RefusalCode.RECIPE)


def told_recipes(recipes: tuple[Recipe, ...]) -> str:
    """What is made by itself, in words."""
    return "; ".join(map(_told, recipes)) or "nothing is made by itself"


def _told(recipe: Recipe) -> str:
    settings = recipe.settings
    if recipe.command == "measure":
        what = f"droplets in {_told_box(settings.get('grid'))}"
    else:
        what = f"volumes by {str(settings.get('method')).upper()}, accuracy {settings.get('accuracy')}"
    return f"{what} (recipe {recipe.sha256[:8]})"


def _told_box(grid: JsonValue) -> str:
    if not isinstance(grid, dict):
        return str(grid or "all that the views see")
    voxels = GridSettings.model_validate_json(json.dumps(grid)).to_grid()
    spans_mm = (getattr(voxels, f"{axis}_mm")[[0, -1]] for axis in "xyz")
    return f"the box {','.join(f'{first:.4g}:{last:.4g}' for first, last in spans_mm)} mm"


def _measures(plan: RunPlan) -> bool:
    return any(recipe.command == "measure" for recipe in plan.recipes or ())


def _is_background(runs: RunStore, run_id: str) -> bool:
    try:
        return runs.summary(run_id).kind is RunKind.BACKGROUND
    except NotFound:
        return False


def _wrong(recipe: Recipe, what: str) -> Unprocessable:
    return Unprocessable(f"recipes: {recipe.command}: {what}", RefusalCode.RECIPE)
