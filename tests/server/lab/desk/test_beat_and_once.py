"""A request makes light once, and now or never."""

import threading
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest

from daq.run_plan import RunPlan
from server.lab.desk.beat import MOST_BEHIND_S, NEVER, PERIOD_S, Beat
from server.lab.desk.once import Once, described
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
    with pytest.raises(Stale, match="had not heard the server yet"):
        beat.require_fresh(NEVER)
    with pytest.raises(Stale, match=r"was 2\.2 s on its way"):
        beat.require_fresh(heard)
    with pytest.raises(Stale, match="has not had"):
        beat.require_fresh(beat.number + 2)


def test_beats_of_another_life_of_the_server_are_old() -> None:
    before, after = Beat(lambda: 500.0, since_s=1e9), Beat(lambda: 3.0, since_s=1e9 + 60)
    with pytest.raises(Stale, match=r"60\.0 s"):
        after.require_fresh(before.number)


def dying() -> str:
    """As where the power fails."""
    raise KeyboardInterrupt


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


def test_a_later_program_with_more_to_be_said_knows_a_request_again() -> None:
    class LaterPlan(RunPlan):
        more: int = 7

    said = {"name": "run", "shots": 2, "pulse": {"current_a": {"view1": 5}}}
    assert described("run", LaterPlan.model_validate(said)) == described("run", RunPlan.model_validate(said))
    assert described("run", RunPlan.model_validate(said)) != described(
        "run", RunPlan.model_validate(said | {"shots": 3})
    )


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
        with pytest.raises(KeyboardInterrupt):
            before.do("c", "run", dying)
    with closing(RequestTable(tmp_path / "requests.sqlite")) as table:
        after = Once(table=table)
        assert after.do("a", "jobs", lambda: ["other"]) == ["job 1", "job 2"]
        assert after.do("b", "run", lambda: "now") == "now"
        with pytest.raises(Conflict) as refusal:
            after.do("c", "run", lambda: "twice")
        assert refusal.value.code == "outcome_unknown"
        with pytest.raises(Unprocessable, match="another request"):
            after.do("a", "run", lambda: "other")


def test_a_table_that_takes_or_gives_nothing_stops_no_request_and_that_is_told_once(tmp_path: Path) -> None:
    events, done = EventPublisher(), list[int]()

    def act() -> str:
        done.append(1)
        return "run 1"

    with opened_requests(tmp_path / "requests.sqlite", events) as table:
        once = Once(table=table)
        table._database.execute("PRAGMA query_only = ON")  # as on a disk that has become read-only
        for _ in range(2):
            assert once.do("a", "run", act) == "run 1"
            with pytest.raises(Conflict, match="busy"):
                once.do("b", "run", failing([]))
        (told,) = events.since(0)
        assert told.name == "file_damaged"
        assert "is obeyed again" in str(told.data["reason"])
        table._database.execute("PRAGMA query_only = OFF")
        table._database.execute("DROP TABLE request")  # as where a page of the file is torn
        assert once.do("c", "run", act) == "run 1"
        assert len(events.since(0)) == 1
    assert len(done) == 2


def test_an_answer_that_cannot_be_read_any_more_is_unknown(tmp_path: Path) -> None:
    with closing(RequestTable(tmp_path / "requests.sqlite")) as table:
        Once(table=table).do("a", "run", lambda: "run 1")
        table._database.execute("UPDATE request SET answer = substr(answer, 2)")
        with pytest.raises(Conflict) as refusal:
            Once(table=table).do("a", "run", lambda: "twice")
    assert refusal.value.code == "outcome_unknown"


def test_what_is_remembered_of_a_request_is_small_however_long_it_is_and_however_often_it_comes(tmp_path: Path) -> None:
    path, long = tmp_path / "requests.sqlite", "run " + "x" * 900_000
    with closing(RequestTable(path)) as table:
        once = Once(table=table)
        for key in "abc":
            assert once.do(key, long, lambda: 1) == 1
        assert sum(len(known[0]) for known in once._known.values()) < 1000
    assert path.stat().st_size < 100_000
    depths = []
    for _ in range(5):
        with pytest.raises(Conflict) as refusal:
            once.do("d", "run", failing([]))
        depths.append(len(refusal.traceback))
    assert depths[1:] == depths[1:2] * 4


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
