"""A run plan as a TOML file, checked before anything is asked: errors name file and line."""

import tomllib
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from daq.run_plan import RunPlan
from processing.errors import BadInput
from processing.runs.toml_lines import line_of


def read_plan(path: Path) -> dict[str, Any]:
    """Read a plan, as the API takes it.

    Raises
    ------
    BadInput
        The file cannot be read, is no TOML, or has values that are out of range or unknown.
    """
    try:
        text = path.read_text(encoding="utf-8")
        plan = RunPlan.model_validate(tomllib.loads(text))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise BadInput(f"{path}: {getattr(error, 'strerror', None) or error}") from error
    except ValidationError as error:
        raise BadInput("\n".join(_problem(path, text, problem) for problem in error.errors())) from error
    return plan.model_dump(mode="json", exclude_unset=True)


def _problem(path: Path, text: str, problem: Any) -> str:
    line = line_of(text, problem["loc"])
    key = ".".join(map(str, problem["loc"]))
    return f"{path}{f':{line}' if line else ''}: {key}: {problem['msg'].removeprefix('Value error, ')}"
