"""Every cause is explained, here and on the page for operators."""

from pathlib import Path

import pytest

from daq.causes import EXPLANATIONS, CauseCode

PAGE = Path(__file__).parents[2] / "docs" / "operate.md"


@pytest.mark.parametrize("code", CauseCode)
def test_a_cause_says_what_it_means_and_what_to_do_in_code_and_on_the_page(code: CauseCode) -> None:
    explanation = EXPLANATIONS[code]
    row = f"| `{code}` | {explanation.meaning} | {explanation.remedy} |"
    assert row in PAGE.read_text(encoding="utf-8").splitlines()
