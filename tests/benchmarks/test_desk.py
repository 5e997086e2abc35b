"""What ``bench`` says of the desk where there is no browser."""

from pathlib import Path
from typing import cast

import pytest

from processing.benchmarks import targets
from processing.benchmarks.targets import Measured, markdown_table, renewed
from server.cli.benchmarks import chromium
from server.cli.benchmarks.browsed import browsed
from server.cli.benchmarks.served import Server


def test_without_a_browser_the_lines_say_so(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(chromium, "CHROMIUM", tmp_path / "chromium")
    lines = list(browsed(cast("Server", None), {}, times=1))
    assert [line.target for line in lines] == [targets.FIRST_PAGE, targets.ABORT, targets.DRAG]
    assert {(line.value, line.how) for line in lines} == {(None, f"{tmp_path / 'chromium'} is not installed")}


def test_a_line_that_was_not_measured_reaches_nothing_and_is_replaced_by_one_that_was() -> None:
    table = markdown_table([Measured(targets.DRAG, None, how="no browser")])
    assert "| not measured |         |" in table
    assert "| 2 requests | aim     |" in renewed(table, [Measured(targets.DRAG, 2)])
    assert "not measured" not in renewed(table, [Measured(targets.DRAG, 2)])
