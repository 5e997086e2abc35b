import pytest

from daq.errors import DaqError, InterlockOpen
from daq.run.refusals import REMEDIES, RefusalCode, coded
from server.lab.desk.reason import refusal_text
from server.lab.errors import ServerError, Stale


@pytest.mark.parametrize("code", RefusalCode)
def test_a_refusal_is_told_with_its_remedy(code: RefusalCode) -> None:
    assert refusal_text(coded(InterlockOpen("the door is open"), code)) == f"the door is open ({REMEDIES[code]})"


@pytest.mark.parametrize(
    "error", [ValueError("odd"), DaqError("odd"), ServerError("odd"), Stale("odd", "stale_request")]
)
def test_where_no_remedy_is_known_the_text_stands_alone(error: Exception) -> None:
    assert refusal_text(error) == "odd"
