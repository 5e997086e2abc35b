"""Recipes: method and all settings of a command in a TOML file, so that runs are comparable.

::

    schema = "tomoshadow/recipe"
    schema_version = 1
    command = "measure"
    method_version = 1            # optional: of what the numbers mean

    [settings]                    # what is left out has its default
    twins = 1
"""

import hashlib
import json
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from pydantic import BaseModel, Field, ValidationError

from daq.files.atomic_file import replacing
from processing.errors import BadInput
from processing.reconstruction.settings import FrozenValue
from processing.runs.toml_lines import Key, line_of

SCHEMA: Literal["tomoshadow/recipe"] = "tomoshadow/recipe"
SCHEMA_VERSION: Literal[1] = 1
Settings = TypeVar("Settings", bound=FrozenValue)


class RecipeError(BadInput):
    """A recipe cannot be followed; the text names file, line and key."""


_SINGLE_VIEW = "measure-single-view"
_REMEDIES = {
    ("measure", _SINGLE_VIEW): "; state the --calibration",
    (_SINGLE_VIEW, "measure"): "; leave out --calibration",
}
"""What makes of one command the other, which a recipe may be for."""


class _Recipe(FrozenValue):
    schema_name: Annotated[Literal["tomoshadow/recipe"], Field(alias="schema")]
    schema_version: Literal[1]
    command: str
    method_version: int | None = None
    settings: Annotated[dict[str, Any], Field(default_factory=dict)]


def read_recipe(path: Path, command: str, method_version: int, kind: type[Settings]) -> Settings:
    """Settings of a recipe; all that it does not say has its default.

    Parameters
    ----------
    path : Path
        TOML.
    command : str
        Whose recipe is wanted.
    method_version : int
        Of what the numbers of this program mean.
    kind : type
        Of the settings.

    Raises
    ------
    RecipeError
        The file cannot be read, a key is misspelt or wrong, or it is a recipe for something else; with the line.
    """
    text = _text(path)
    recipe = _validated(path, text, (), _document(path, text), _Recipe)
    if recipe.command != command:
        problem = f"a recipe for {recipe.command}, not for {command}{_REMEDIES.get((recipe.command, command), '')}"
        raise _error(path, text, ("command",), problem)
    if recipe.method_version not in (None, method_version):
        raise _error(
            path,
            text,
            ("method_version",),
            f"numbers of version {recipe.method_version} of the method are not comparable with those of version "
            f"{method_version}, which this program makes; take the line out if that is what you want",
        )
    return _validated(path, text, ("settings",), recipe.settings, kind)


def write_recipe(path: Path, command: str, method_version: int, settings: FrozenValue) -> None:
    """Write the recipe of what was done, every setting spelled out with what it means.

    Parameters
    ----------
    path : Path
        Usually ``*.toml``; an existing file is replaced.
    command : str
        Whose settings they are.
    method_version : int
        Of what its numbers mean.
    settings : FrozenValue
        All of them.
    """
    lines = [
        f"# SHA-256 {recipe_sha256(command, method_version, settings)}, of what is said, not of how it is written",
        f"schema = {_toml(SCHEMA)}",
        f"schema_version = {SCHEMA_VERSION}",
        f"command = {_toml(command)}",
        f"method_version = {method_version}",
        *_tables("settings", settings),
    ]
    with replacing(path) as part:
        part.write_text("\n".join(lines) + "\n", encoding="utf-8")


def recipe_sha256(command: str, method_version: int, settings: FrozenValue) -> str:
    """Hash of a recipe: the same for the same command, method and settings, wherever they come from."""
    said = {"command": command, "method_version": method_version, "settings": settings.model_dump(mode="json")}
    return hashlib.sha256(json.dumps(said, sort_keys=True).encode()).hexdigest()


def _document(path: Path, text: str) -> dict[str, Any]:
    """Tables and values of a TOML text; a RecipeError that names the line where it is none."""
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise RecipeError(f"{path}: {error}") from error


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise RecipeError(f"{path}: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise RecipeError(f"{path}: not UTF-8: byte {error.start} is {error.object[error.start]:#x}") from error


def _validated(path: Path, text: str, table: Key, values: Mapping[str, Any], kind: type[Settings]) -> Settings:
    """The value that a table says; as JSON, whose strict types are those of TOML: true is no number, "1" neither."""
    try:
        return kind.model_validate_json(json.dumps(values, default=str), strict=True)
    except ValidationError as error:
        first = min(error.errors(), key=lambda problem: problem["type"] != "extra_forbidden")
        known = f"; the keys here are {', '.join(_keys(kind))}" if first["type"] == "extra_forbidden" else ""
        raise _error(path, text, (*table, *first["loc"]), _PROBLEMS.get(first["type"], first["msg"]) + known) from error


_PROBLEMS = {"extra_forbidden": "there is no such key here; is it misspelt?", "missing": "this key is missing"}


def _keys(kind: type[BaseModel]) -> Iterator[str]:
    return (field.alias or name for name, field in kind.model_fields.items())


def _error(path: Path, text: str, key: Key, problem: str) -> RecipeError:
    line = line_of(text, key)
    where = f"{path}, line {line}" if line else str(path)
    return RecipeError(f"{where}: {'.'.join(map(str, key))}: {problem}")


def _tables(name: str, settings: BaseModel) -> Iterator[str]:
    """A table, and after it those within it; what is not set is a comment."""
    yield from ("", f"[{name}]")
    values = settings.model_dump(mode="json")
    for key, field in type(settings).model_fields.items():
        if isinstance(getattr(settings, key), BaseModel):
            continue
        if field.description:
            yield f"# {field.description}"
        yield f"# {key} is not set" if values[key] is None else f"{key} = {_toml(values[key])}"
    for key, value in settings:
        if isinstance(value, BaseModel):
            yield from _tables(f"{name}.{key}", value)


def _toml(value: Any) -> str:
    """A value; strings, numbers, lists and truth are written in TOML as in JSON."""
    return json.dumps(value, ensure_ascii=False)
