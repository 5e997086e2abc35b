"""What commands say: tables, the object and the text, and streams that nobody reads."""

import json
import os

import pytest

from server.cli.output import Outcome, say, table, tell


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
