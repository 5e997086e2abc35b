"""How told shares of ghosts are judged by true ones."""

from dataclasses import replace

import pytest

from processing.analysis.droplets.ghost_share import GhostShare
from processing.studies.real_droplets.case_shares import CaseShare, all_close, share_statements

SHARES = [
    CaseShare("shadows", f"{percent} %", 1.05, 1.2 * 10 * percent, GhostShare(10 * percent, 1000))
    for percent in (0, 2, 3, 5, 8, 11, 14)
]


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
        [*SHARES[:-1], replace(SHARES[-1], expected=40.0)],
        [replace(SHARES[0], expected=6.0), *SHARES[1:]],
        [*SHARES[:3], *(replace(one, expected=1500 / (k + 20)) for k, one in enumerate(SHARES[3:]))],
    ],
    ids=["too few", "far off", "none where some are told", "order"],
)
def test_shares_that_are_not_fail(shares: list[CaseShare]) -> None:
    assert not all_close(shares)


def test_half_a_point_is_close_enough() -> None:
    few = CaseShare("shadows", "few", 1.0, 5.0, GhostShare(1, 1000))
    assert few.close
    assert not replace(few, expected=7.0).close


def test_of_bright_particles_many_ghosts_are_not_told_and_not_judged() -> None:
    bright = replace(SHARES[4], kind="bright", expected=300.0)
    assert all_close([*SHARES, bright])
    assert not all_close([*SHARES, replace(bright, expected=8.0)])
    assert "not told (30.00 % expected), true 8.00 %" in share_statements([bright])[1].ours
