"""What was lost comes back by itself: faults by the API of the bench, lamps and runs by REST, no restart in between."""

from collections.abc import Iterator

import pytest

from daq.devices import GeneratorState
from daq.run.state import RunOutcome
from tests.support.simulated_serving import BenchServing, eventually, serving_bench, tiny_config

pytestmark = pytest.mark.network


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[BenchServing]:
    with serving_bench(tiny_config(tmp_path_factory.mktemp("recovery") / "runs")) as served:
        yield served


IDLE_FAULTS = {
    "power for a second": ("view2", {"kind": "power_cycled", "view": "view2", "amount": 1.0}),
    "cable for longer than a heartbeat": ("view2", {"kind": "frozen", "view": "view2", "duration_s": 4.0}),
    "cable of the generator": ("pulse generator", {"kind": "generator_unplugged", "duration_s": 1.5}),
    "microcontroller": ("pulse generator", {"kind": "generator_hang", "duration_s": 2.5}),
    "cable of the stage": ("stage", {"kind": "stage_unplugged", "duration_s": 1.5}),
}


@pytest.mark.parametrize(("lamp", "fault"), IDLE_FAULTS.values(), ids=IDLE_FAULTS)
def test_what_was_away_between_runs_is_back_for_the_next_one(
    bench: BenchServing, lamp: str, fault: dict[str, object]
) -> None:
    bench.await_lamp(lamp, "ok")
    bench.inject(**fault)  # type: ignore[arg-type]
    dark = bench.await_lamp(lamp, "fault")
    assert "last answer" in dark["detail"]
    bright = bench.await_lamp(lamp, "ok")
    assert bright["age_s"] < 2.5
    bench.assert_next_run_is_sound()


def test_control_that_was_given_back_is_taken_again(bench: BenchServing) -> None:
    with bench.during("control_taken", view="view1"):
        assert "taken over by 10.99.99.99:50000" in bench.await_lamp("view1", "fault")["detail"]
        status = bench.run()
    assert status.outcome is RunOutcome.FAILED
    assert "view1: the camera at 127.0.6.1 was taken over by 10.99.99.99:50000" in status.message
    bench.await_lamp("view1", "ok")
    bench.assert_next_run_is_sound()


def test_a_run_that_starts_before_anybody_has_noticed_opens_the_camera_itself(bench: BenchServing) -> None:
    with bench.during("killed", view="view1"):
        pass
    bench.assert_next_run_is_sound()


def test_a_run_while_a_camera_is_away_names_it(bench: BenchServing) -> None:
    with bench.during("killed", view="view2"):
        status = bench.run()
    assert status.outcome is RunOutcome.FAILED
    assert "view2: no camera answers at 127.0.6.2" in status.message
    bench.assert_next_run_is_sound()


def test_a_camera_that_goes_in_a_run_ends_it_and_is_back_for_the_next_one(bench: BenchServing) -> None:
    bench.start(1000)
    bench.await_shots(2)
    bench.inject("power_cycled", view="view2", amount=2.0)
    status = bench.end()
    assert status.outcome is RunOutcome.FAILED
    assert "view2" in status.message
    assert bench.rig.generator.status().state is GeneratorState.SAFE
    bench.await_lamp("view2", "ok")
    bench.assert_next_run_is_sound()


def test_a_generator_that_is_unplugged_in_a_run_is_a_fault_until_it_is_acknowledged(bench: BenchServing) -> None:
    bench.start(1000)
    bench.await_shots(1)
    with bench.during("generator_unplugged"):
        assert bench.end().outcome is RunOutcome.FAILED
        assert bench.http.get("/api/rig").json()["acquisition"]["state"] == "fault"
    eventually(lambda: "restarted" in bench.lamp("pulse generator")["detail"], lambda: bench.lamp("pulse generator"))
    assert bench.http.post("/api/rig/acknowledge").status_code == 202
    assert bench.rig.generator.status().state is GeneratorState.SAFE
    bench.assert_next_run_is_sound()


def test_a_few_bad_replies_cost_nothing(bench: BenchServing) -> None:
    bench.start(6)
    bench.await_shots(1)
    bench.inject("replies_lost", amount=1)
    bench.inject("replies_damaged", amount=2)
    assert bench.end().outcome is RunOutcome.COMPLETED


def test_an_emergency_stop_ends_a_run_and_locks_the_next_one(bench: BenchServing) -> None:
    bench.start(1000)
    bench.await_shots(1)
    with bench.during("estop_pressed"):
        status = bench.end()
    assert status.outcome is RunOutcome.FAILED
    assert "stop" in status.message
    assert bench.http.post("/api/rig/acknowledge").status_code == 202
    bench.assert_next_run_is_sound()
