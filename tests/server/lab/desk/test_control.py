"""Who holds control: the first who acts, for ten minutes after his last action, until somebody takes it over."""

from typing import Any

import pytest

from server.lab.desk.control import KEPT_S, Control
from server.lab.desk.visitor import Role, Visitor, named_script, unnamed_script
from server.lab.errors import Forbidden, Locked, Unprocessable

ANN, BOB = Visitor("a", "ann"), Visitor("b", "bob")


class Bench:
    """A control with a clock that is set by hand, and what it told."""

    def __init__(self) -> None:
        self.now_s, self.is_busy = 0.0, False
        self.told: list[tuple[str, dict[str, Any]]] = []
        self.control = Control(lambda: self.is_busy, self._tell, lambda: self.now_s)

    def _tell(self, name: str, **data: Any) -> None:
        self.told.append((name, data))


def test_the_first_who_acts_holds_it_and_another_one_is_refused_by_name() -> None:
    control = Bench().control
    control.require(ANN)
    control.require(ANN)
    with pytest.raises(Locked, match="ann holds control") as refusal:
        control.require(BOB)
    assert refusal.value.code == "control_held"


def test_ten_minutes_without_action_free_it_and_every_action_counts() -> None:
    bench = Bench()
    bench.control.require(ANN)
    bench.now_s = KEPT_S - 1
    bench.control.require(ANN)
    bench.now_s += KEPT_S - 1
    with pytest.raises(Locked):
        bench.control.require(BOB)
    bench.now_s += 1
    bench.control.require(BOB)


def test_a_run_keeps_it_however_long_it_lasts() -> None:
    bench = Bench()
    bench.control.require(ANN)
    bench.is_busy = True
    for _ in range(3):
        bench.now_s += KEPT_S / 2
        assert bench.control.holder is not None
    bench.is_busy = False
    bench.now_s += KEPT_S - 1
    with pytest.raises(Locked):
        bench.control.require(BOB)


def test_it_is_taken_over_and_everybody_is_told() -> None:
    bench = Bench()
    bench.control.require(ANN)
    bench.control.take(BOB)
    with pytest.raises(Locked, match="bob"):
        bench.control.require(ANN)
    assert bench.told[-1] == ("control", {"holder": "bob", "before": "ann", "text": "bob has taken control from ann"})
    bench.control.release(ANN)
    assert bench.control.holder is not None
    assert bench.control.holder.who == BOB
    bench.control.release(BOB)
    assert bench.control.holder is None


def test_a_script_without_a_name_acts_while_nobody_holds_it_and_cannot_hold_it() -> None:
    bench, script = Bench(), unnamed_script("127.0.0.1")
    bench.control.require(script)
    assert bench.control.holder is None
    with pytest.raises(Unprocessable) as refusal:
        bench.control.take(script)
    assert refusal.value.code == "no_name"
    bench.control.require(named_script("cron@lab"))
    with pytest.raises(Locked):
        bench.control.require(script)


def test_a_viewer_never_acts() -> None:
    bench, viewer = Bench(), Visitor("v", "eve", Role.VIEWER)
    for ask in (bench.control.require, bench.control.take):
        with pytest.raises(Forbidden) as refusal:
            ask(viewer)
        assert refusal.value.code == "viewer"
    assert bench.control.holder is None


def test_what_fails_takes_no_control_and_leaves_it_to_who_has_it() -> None:
    control = Bench().control
    with pytest.raises(ValueError, match="no"), control.acting(ANN):
        raise ValueError("no")
    assert control.holder is None
    with control.acting(ANN):
        pass
    with pytest.raises(ValueError, match="no"), control.acting(ANN):
        raise ValueError("no")
    assert control.holder is not None
