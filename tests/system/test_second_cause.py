"""A second cause is not hidden by the first one, and no lamp shows what was once true."""

from collections.abc import Iterator

import pytest

from daq.faults import Fault, FaultKind
from daq.run.state import RunOutcome
from tests.support.simulated_serving import BenchServing, eventually, serving_bench, tiny_config

pytestmark = pytest.mark.network


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[BenchServing]:
    with serving_bench(tiny_config(tmp_path_factory.mktemp("causes") / "runs", subnet=7)) as served:
        yield served


def acknowledge(bench: BenchServing) -> int:
    return bench.http.post("/api/rig/acknowledge").status_code


def detail(bench: BenchServing, lamp: str) -> str:
    return str(bench.lamp(lamp)["detail"])


def waiting(bench: BenchServing) -> list[str]:
    """Codes of the causes that are to be acknowledged; each has a remedy."""
    causes: list[dict[str, str]] = bench.http.get("/api/rig").json()["acquisition"]["to_acknowledge"]
    assert all(cause["remedy"] for cause in causes)
    return [cause["code"] for cause in causes]


def refusal(bench: BenchServing) -> tuple[int, str]:
    pulse = {"current_a": {"view1": 25.0, "view2": 9.9}}
    answer = bench.http.post("/api/runs", json={"name": "early", "kind": "background", "shots": 1, "pulse": pulse})
    return answer.status_code, str(answer.json().get("detail"))


def test_a_generator_that_restarts_as_the_door_opens_is_named_until_it_is_acknowledged_by_itself(
    bench: BenchServing,
) -> None:
    bench.start(1000, rate_hz=1.0)
    bench.await_shots(1)
    bench.laboratory.inject(Fault(kind=FaultKind.GENERATOR_RESET))  # not by HTTP: before anybody asks the generator
    bench.laboratory.open_door()
    with bench.during("interlock_open"):
        assert bench.end().outcome is RunOutcome.FAILED
        eventually(lambda: detail(bench, "interlock").startswith("open"), lambda: detail(bench, "interlock"))
        assert refusal(bench)[0] == 423
    bench.await_lamp("interlock", "ok")
    eventually(lambda: detail(bench, "pulse generator") == "fault, restarted", lambda: detail(bench, "pulse generator"))
    for left in (["generator_failed", "interlock_open"], waiting(bench)[1:]):
        assert sorted(waiting(bench)) == left
        status, reason = refusal(bench)
        assert status == 423
        assert "to be acknowledged" in reason
        assert acknowledge(bench) == 202
    assert waiting(bench) == []
    bench.assert_next_run_is_sound()


def test_what_cannot_be_acknowledged_yet_says_why(bench: BenchServing) -> None:
    bench.start(1000)
    bench.await_shots(1)
    with bench.during("interlock_open"):
        assert bench.end().outcome is RunOutcome.FAILED
        assert acknowledge(bench) == 423
    assert acknowledge(bench) == 202
    bench.assert_next_run_is_sound()


@pytest.mark.parametrize(
    ("lamp", "kind", "fields"),
    [
        ("pulse generator", "generator_hang", {}),
        ("view1", "frozen", {"view": "view1"}),
    ],
)
def test_a_lamp_of_a_silent_device_does_not_show_its_last_value(
    bench: BenchServing, lamp: str, kind: str, fields: dict[str, str]
) -> None:
    eventually(lambda: detail(bench, "pulse generator") == "safe", lambda: detail(bench, "pulse generator"))
    last = detail(bench, lamp)
    with bench.during(kind, **fields):
        shown = bench.await_lamp(lamp, "fault")["detail"]
        assert last not in shown
        assert "last answer" in shown
    bench.await_lamp(lamp, "ok")
    assert detail(bench, lamp) == last
