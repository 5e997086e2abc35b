"""A request makes light once, and now or never."""

import threading
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest

from server.lab.desk.beat import MOST_BEHIND_S, PERIOD_S, Beat
from server.lab.desk.once import Once
from server.lab.desk.request_table import RequestTable, opened_requests
from server.lab.errors import Conflict, Stale, Unprocessable
from server.lab.events import EventPublisher


def test_a_beat_is_fresh_for_two_seconds_and_not_before_it_has_been() -> None:
    now_s = [10.0]
    beat = Beat(lambda: now_s[0], since_s=1e9)
    heard = beat.number
    now_s[0] += MOST_BEHIND_S
    beat.require_fresh(heard)
    now_s[0] += PERIOD_S
    with pytest.raises(Stale, match=r"was 2\.2 s on its way"):
        beat.require_fresh(heard)
    with pytest.raises(Stale, match="has not had"):
        beat.require_fresh(beat.number + 2)


def test_beats_of_another_life_of_the_server_are_old() -> None:
    before, after = Beat(lambda: 500.0, since_s=1e9), Beat(lambda: 3.0, since_s=1e9 + 60)
    with pytest.raises(Stale, match=r"60\.0 s"):
        after.require_fresh(before.number)


def failing(times: list[int]) -> Callable[[], int]:
    def act() -> int:
        times.append(1)
        raise Conflict("busy")

    return act


def test_a_key_is_obeyed_once_and_answered_always_the_same() -> None:
    once, done = Once(kept=2), list[int]()

    def act(result: int) -> Callable[[], int]:
        def answer() -> int:
            done.append(1)
            return result

        return answer

    for _ in range(3):
        assert once.do("a", "run", act(7)) == 7
        with pytest.raises(Conflict, match="busy"):
            once.do("b", "run", failing(done))
    assert len(done) == 2
    with pytest.raises(Unprocessable, match="another request"):
        once.do("a", "another run", lambda: 8)
    for key in (None, None, "c", "a"):  # no key is no repetition; the oldest of more than two keys is forgotten
        assert once.do(key, "run", act(9)) == 9
    assert len(done) == 6


def test_the_same_request_that_comes_while_it_is_obeyed_is_told_so() -> None:
    once, entered, leave = Once(), threading.Event(), threading.Event()

    def act() -> int:
        entered.set()
        leave.wait(60)
        return 1

    thread = threading.Thread(target=once.do, args=("a", "run", act))
    thread.start()
    assert entered.wait(60)
    with pytest.raises(Conflict, match="being worked on"):
        once.do("a", "run", act)
    leave.set()
    thread.join(60)
    assert once.do("a", "run", act) == 1


def test_a_key_is_known_after_a_restart_and_what_was_refused_may_be_asked_again(tmp_path: Path) -> None:
    with closing(RequestTable(tmp_path / "requests.sqlite")) as table:
        before = Once(table=table)
        assert before.do("a", "jobs", lambda: ["job 1", "job 2"]) == ["job 1", "job 2"]
        with pytest.raises(Conflict, match="busy"):
            before.do("b", "run", failing([]))
        table.begin("c", "run")  # and the power fails
    with closing(RequestTable(tmp_path / "requests.sqlite")) as table:
        after = Once(table=table)
        assert after.do("a", "jobs", lambda: ["other"]) == ["job 1", "job 2"]
        assert after.do("b", "run", lambda: "now") == "now"
        with pytest.raises(Conflict) as refusal:
            after.do("c", "run", lambda: "twice")
        assert refusal.value.code == "outcome_unknown"
        with pytest.raises(Unprocessable, match="another request"):
            after.do("a", "run", lambda: "other")


def test_the_table_of_requests_is_bounded_and_a_damaged_one_is_set_aside(tmp_path: Path) -> None:
    path = tmp_path / "requests.sqlite"
    path.write_bytes(b"no database" * 100)
    events = EventPublisher()
    with opened_requests(path, events, kept=3) as table:
        for key in "abcde":
            table.begin(key, "run")
            table.end(key, key)
        assert [table.find(key) is not None for key in "abcde"] == [False, False, True, True, True]
    assert list(tmp_path.glob("requests.sqlite.damaged-*"))
    assert events.since(0)[0].name == "file_damaged"
