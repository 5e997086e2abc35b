"""Commands in the process of the test: what they tell people and programs."""

import json
from typing import Any

import pytest

from server.cli.main import main

GRID = "-1:1,-1:1,-1:1@0.1"


def told(capsys: pytest.CaptureFixture[str], *arguments: object, status: int = 0) -> dict[str, Any]:
    """The JSON object of a command that worked: the last line of its output."""
    assert main([*map(str, arguments), "--json"]) == status
    result: dict[str, Any] = json.loads(capsys.readouterr().out.splitlines()[-1])
    return result


def shown(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """The text of a command that worked, for people."""
    assert main([*map(str, arguments)]) == 0
    return capsys.readouterr().out


def refused(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """The error of a command that did not work: one line for a person, one object for a program."""
    assert main([*map(str, arguments), "--json"]) == 2
    output = capsys.readouterr()
    error: str = json.loads(output.out.splitlines()[-1])["error"]
    assert output.err.endswith(f"tomoshadow: {error}\n")
    assert "Traceback" not in output.err
    return error
