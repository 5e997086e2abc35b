"""``import tomoshadow``: what it offers, that it is explained, and that it loads nothing before it is used."""

import ast
import inspect
import re
from pathlib import Path

import pytest

import tomoshadow
from tests.support.fresh_interpreter import modules_after, packages_of

PACKAGE = Path(tomoshadow.__file__).parent


def imported_for_type_checkers() -> dict[str, str]:
    """Home of every name in the block that only type checkers read."""
    tree = ast.parse((PACKAGE / "__init__.py").read_text(encoding="utf-8"))
    block = next(node for node in tree.body if isinstance(node, ast.If))
    imports = [node for node in block.body if isinstance(node, ast.ImportFrom)]
    return {alias.asname or alias.name: node.module or "" for node in imports for alias in node.names}


def test_type_checkers_see_the_names_that_python_loads() -> None:
    assert imported_for_type_checkers() == tomoshadow._HOME_OF
    assert dir(tomoshadow) == sorted(tomoshadow._HOME_OF)
    assert (PACKAGE / "py.typed").exists()


@pytest.mark.parametrize("name", [name for name in dir(tomoshadow) if name != "BadInput"])
def test_help_tells_everything_of_a_name(name: str) -> None:
    value, text = getattr(tomoshadow, name), inspect.getdoc(getattr(tomoshadow, name)) or ""
    assert len(text) > 40
    assert name in str(tomoshadow.__doc__)
    for parameter in inspect.signature(value).parameters.values():
        assert parameter.kind is not inspect.Parameter.VAR_KEYWORD, f"{name} takes misspelt options"
        assert re.search(rf"^({parameter.name}\b|\w+, {parameter.name}\b)", text, re.MULTILINE) or inherits(text), (
            parameter.name
        )


def inherits(text: str) -> bool:
    """It says whose help has the rest."""
    return "All else as ``" in text


def test_a_name_that_is_none_is_told_with_those_that_are() -> None:
    with pytest.raises(AttributeError, match=r"tomoshadow has no 'smrt'; it has .*smart"):
        _ = tomoshadow.smrt


def test_importing_it_loads_nothing_heavy() -> None:
    loaded = packages_of(modules_after("import tomoshadow"))
    assert "tomoshadow" in loaded
    assert not loaded & {"numpy", "cv2", "scipy", "h5py", "daq", "processing"}


def test_it_needs_neither_server_nor_devices() -> None:
    loaded = packages_of(modules_after("import tomoshadow\nfor name in dir(tomoshadow): getattr(tomoshadow, name)"))
    assert "processing" in loaded
    assert not loaded & {"server", "fastapi", "nicegui", "gi", "serial", "gpiod", "distributed"}
