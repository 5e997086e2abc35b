"""Every cause is explained, here and on the page for operators."""

from pathlib import Path

import pytest

from daq.causes import EXPLANATIONS, Cause, CauseCode, to_acknowledge

PAGE = Path(__file__).parents[2] / "docs" / "operate.md"


@pytest.mark.parametrize("code", CauseCode)
def test_a_cause_says_what_it_means_and_what_to_do_in_code_and_on_the_page(code: CauseCode) -> None:
    explanation = EXPLANATIONS[code]
    row = f"| `{code}` | {explanation.meaning} | {explanation.remedy} |"
    assert row in PAGE.read_text(encoding="utf-8").splitlines()


@pytest.mark.parametrize(
    ("causes", "waiting"),
    [
        ("", ""),
        ("interlock_open", ""),
        ("interlock_open generator_failed", "interlock_open generator_failed"),
        ("generator_failed light_not_off", "generator_failed"),
        ("aborted light_not_off", ""),
        ("aborted camera_failed", "camera_failed"),
    ],
)
def test_where_there_are_several_each_is_acknowledged_by_itself(causes: str, waiting: str) -> None:
    several = tuple(Cause(CauseCode(code), code) for code in causes.split())
    assert " ".join(cause.code for cause in to_acknowledge(several)) == waiting
