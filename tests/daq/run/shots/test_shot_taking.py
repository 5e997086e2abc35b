"""When shots are due: an exact period, and never an early trigger."""

from collections.abc import Iterator
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from daq.run.shots.shot_taking import next_due_s

PERIOD_S, SHORTEST_S = 0.05, 0.012


def fired(late_s: list[float], answer_s: float) -> Iterator[tuple[float, float]]:
    """When shots are commanded and confirmed, if each is sent so much after it is due."""
    due_s = 0.0
    for late in late_s:
        times = (due_s + late, due_s + late + answer_s)
        yield times
        due_s = next_due_s(due_s, times, PERIOD_S, SHORTEST_S)


def test_little_delays_do_not_add_up() -> None:
    commanded_s = [commanded for commanded, _ in fired([0.001, 0.006, 0.0, 0.012] * 50, answer_s=0.007)]
    assert commanded_s[-1] == pytest.approx(199 * PERIOD_S + 0.012, abs=1e-9)


def test_after_a_long_delay_nothing_is_caught_up() -> None:
    commanded_s = [commanded for commanded, _ in fired([0.0, 0.0, 1.0, 0.0, 0.0], answer_s=0.007)]
    gaps_s = [after - before for before, after in pairwise(commanded_s)]
    assert gaps_s == pytest.approx([PERIOD_S, PERIOD_S + 1.0, PERIOD_S, PERIOD_S])


def test_the_first_shot_begins_the_time_of_all() -> None:
    assert next_due_s(0.0, (1234.0, 1234.01), PERIOD_S, SHORTEST_S) == pytest.approx(1234.0 + PERIOD_S)


@given(
    st.lists(st.floats(0, 2), min_size=2, max_size=20),
    st.floats(0, 0.2),
    st.floats(0, 1),
)
def test_no_trigger_is_early_wherever_in_its_answer_the_last_one_was(
    late_s: list[float], answer_s: float, where: float
) -> None:
    for (commanded, confirmed), (after, _) in pairwise(fired(late_s, answer_s)):
        triggered_s = commanded + where * (confirmed - commanded)
        assert after - triggered_s >= max(SHORTEST_S, PERIOD_S / 2) - 1e-9
