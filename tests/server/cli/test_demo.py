"""``tomoshadow demo``, where it cannot run; ``tests/system`` runs it."""

from pathlib import Path

import pytest

from server.cli.main import main


def test_outside_a_clone_it_says_where_to_go(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["demo"]) == 2
    assert capsys.readouterr().err.startswith(
        "tomoshadow: configs/simulated.toml: no such file; run the demonstration in a clone of tomoshadow"
    )
