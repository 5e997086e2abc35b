"""How told shares of ghosts are judged by true ones."""

from dataclasses import replace

import pytest

from processing.analysis.droplets.ghost_share import GhostShare, expected_share
from processing.studies.real_droplets.case_shares import CaseShare, all_close, share_statements


def case(name: str, expected: float, ghosts: int) -> CaseShare:
    """Of a thousand droplets."""
    return CaseShare("shadows", name, 1.05, expected_share(expected, 1000), True, GhostShare(ghosts, 1000))


def telling(share: CaseShare, expected: float) -> CaseShare:
    return replace(share, estimate=expected_share(expected, 1000))


SHARES = [case(f"{percent} %", 1.2 * 10 * percent, 10 * percent) for percent in (0, 2, 3, 5, 8, 11, 14)]


def test_shares_that_are_close_and_in_order_pass() -> None:
    assert all_close(SHARES)
    topic, text = next((one.topic, one.ours) for one in share_statements(SHARES))
    assert topic == "shadows: share of ghosts told"
    assert text == (
        "told of 7 of 7 cases, close in 7, within its interval in 7; of 2 to 15 % close in 6 of 6, "
        "rank correlation 1.00"
    )


@pytest.mark.parametrize(
    "shares",
    [
        SHARES[:-1],
        [*SHARES[:-1], telling(SHARES[-1], 40.0)],
        [telling(SHARES[0], 6.0), *SHARES[1:]],
        [*SHARES[:3], *(telling(one, 1500 / (k + 20)) for k, one in enumerate(SHARES[3:]))],
    ],
    ids=["too few", "far off", "none where some are told", "order"],
)
def test_shares_that_are_not_fail(shares: list[CaseShare]) -> None:
    assert not all_close(shares)


def test_half_a_point_is_close_enough() -> None:
    few = case("few", 5.0, 1)
    assert few.close
    assert not telling(few, 7.0).close


def test_what_is_not_told_is_not_judged() -> None:
    bright = replace(telling(SHARES[4], 300.0), kind="bright", told=False)
    assert all_close([*SHARES, bright])
    assert not all_close([*SHARES, replace(bright, told=True)])
    assert "not told (30.00 % expected), true 8.00 %" in share_statements([bright])[1].ours
