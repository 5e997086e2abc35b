"""Every refusal has a code, a remedy, and a line in the operator's guide."""

import re
from pathlib import Path

from daq.errors import BusyError, PlanError
from daq.run.refusals import REMEDIES, RefusalCode, coded, refused

OPERATE = Path(__file__).parents[3] / "docs" / "operate.md"


def test_the_guide_names_every_refusal_and_its_remedy() -> None:
    rows = re.findall(r"^\| `(\w+)` \| .+ \| (.+) \|$", OPERATE.read_text(), re.MULTILINE)
    assert {(code.value, remedy) for code, remedy in REMEDIES.items()} <= set(rows)
    assert set(REMEDIES) == set(RefusalCode)


def test_a_check_is_coded_unless_it_says_more_itself() -> None:
    def raises(error: Exception) -> None:
        raise error

    assert [error.code for error in refused(RefusalCode.STAGE, raises, PlanError("far"))] == ["stage"]
    own = coded(BusyError("busy"), RefusalCode.BUSY)
    assert [error.code for error in refused(RefusalCode.STAGE, raises, own)] == ["busy"]
    assert [error.code for error in refused(RefusalCode.STAGE, raises, OSError("torn"))] == ["storage"]
    assert not list(refused(RefusalCode.STAGE, len, "fine"))
