"""What commands say: tables, the object and the text, and streams that nobody reads."""

import io
import json
import os
import re

import pytest

from server.cli.output import Bar, Outcome, progress, say, table, tell, tracked


def test_words_stand_left_and_figures_right() -> None:
    rows = [["view1", "60.1", "-45.00"], ["view10", "9.25", ""], ["v", "100", "1e-3"]]
    assert table(["view", "px/mm", "azimuth"], rows) == (
        "view    px/mm  azimuth\n"
        "view1    60.1   -45.00\n"
        "view10   9.25\n"
        "v         100     1e-3"
    )  # fmt: skip


def test_a_table_without_rows_is_its_head() -> None:
    assert table(["shot", "file"], []) == "shot  file"


def test_people_get_the_text_and_programs_the_object(capsys: pytest.CaptureFixture[str]) -> None:
    outcome = Outcome({"views": 4}, "4 views")
    tell(outcome, as_json=False)
    assert capsys.readouterr() == ("4 views\n", "")
    tell(outcome, as_json=True)
    output, beside = capsys.readouterr()
    assert (json.loads(output), beside) == ({"views": 4}, "4 views\n")


def test_what_has_nothing_to_say_says_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    tell(Outcome({}), as_json=False)
    assert capsys.readouterr() == ("", "")


def test_work_goes_on_when_nobody_reads_any_more() -> None:
    reading, writing = os.pipe()
    os.close(reading)
    with os.fdopen(writing, "w") as stream:
        say("lost", stream)
        say("lost, too", stream)
        assert os.path.samestat(os.fstat(stream.fileno()), os.stat(os.devnull))


def test_only_a_result_that_says_so_has_not_passed() -> None:
    assert Outcome({}).passed
    assert not Outcome({"passed": False}).passed


class Terminal(io.StringIO):
    """A terminal of 60 columns."""

    def isatty(self) -> bool:
        return True

    def lines(self) -> list[str]:
        """What stands on it: a line that begins anew is written over."""
        lines = [""]
        for part in re.split(r"(\r\x1b\[K|\n)", self.getvalue()):
            lines = [*lines, ""] if part == "\n" else [*lines[:-1], "" if part.startswith("\r") else lines[-1] + part]
        return lines


def test_a_terminal_shows_a_bar_below_what_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "60")
    monkeypatch.setattr("sys.stderr", terminal := Terminal())
    bars = []
    for item in tracked(["a", "b", "c"], lambda item: f"shot {item}"):
        bars.append(terminal.lines()[-1])
        progress(f"{item} is dark")
    assert [re.sub(r", \d+:\d\d left", "", bar) for bar in bars] == [
        "[........................] 0/3  shot a",
        "[########................] 1/3  shot b",
        "[################........] 2/3  shot c",
    ]
    assert terminal.lines() == ["a is dark", "b is dark", "c is dark", ""]


def test_a_bar_says_how_long_the_rest_takes_and_fits_into_its_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "60")
    monkeypatch.setattr("sys.stderr", terminal := Terminal())
    clock = iter([0.0, 30.0])
    Bar(lambda: next(clock)).step(10, 40, "a run with a name that is far too long for one line")
    (line,) = terminal.lines()
    assert line.startswith("[######..................] 10/40, 1:30 left  a run")
    assert len(line) == 59


def test_elsewhere_every_step_is_a_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert list(tracked([1, 2], lambda item: f"shot {item}")) == [1, 2]
    with Bar() as bar:
        bar.step(1, 2)
    assert capsys.readouterr().err == "shot 1\nshot 2\n"
