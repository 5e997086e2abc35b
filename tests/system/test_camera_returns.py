"""A camera that returns: no image of before passes as one of now, and it has its profile again before the next shot."""

import zlib
from collections.abc import Iterator

import pytest

from daq.files.run_directory import RunReader
from daq.run.state import RunOutcome
from daq.simulation.camera.gige_registers import ExposureMode, Register
from tests.support.simulated_serving import BenchServing, serving_bench, tiny_config

pytestmark = pytest.mark.network
OURS = {Register.EXPOSURE_MODE: ExposureMode.DoubleFrame, Register.TRIGGER_MODE: 1, Register.STREAM_PACKET_SIZE: 9000}
FACTORY = {Register.EXPOSURE_MODE: ExposureMode.Timed, Register.TRIGGER_MODE: 0, Register.STREAM_PACKET_SIZE: 1500}


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[BenchServing]:
    with serving_bench(tiny_config(tmp_path_factory.mktemp("returns") / "runs", subnet=8)) as served:
        yield served


def settings(bench: BenchServing) -> dict[Register, int]:
    """What the second camera is set to."""
    bank = bench.laboratory.devices.cameras["view2"]._bank
    return {register: bank[register] & 0xFFFF for register in OURS}


def frames_of(reader: RunReader) -> tuple[set[int], list[int]]:
    """Checksums of all valid frames of the second view, and their times on its clock."""
    shots = [reader.read_shot(index).views["view2"] for index in range(reader.shot_count)]
    records = [(image, record) for s in shots for image, record in ((s.frame_a, s.record_a), (s.frame_b, s.record_b))]
    valid = [(image, record) for image, record in records if image is not None and record.valid]
    return {zlib.crc32(image.tobytes()) for image, _ in valid}, [record.device_timestamp_ns for _, record in valid]


def test_old_images_never_pass_as_a_new_run(bench: BenchServing) -> None:
    bench.assert_next_run_is_sound()
    images, times_ns = frames_of(bench.reader())
    assert len(images) == 4
    bench.start(1000)
    bench.await_shots(2)
    with bench.during("frozen", view="view2"):
        status = bench.end()
        assert status.outcome is RunOutcome.FAILED
        assert "view2" in status.message
        in_the_run = frames_of(bench.reader())
        assert not images & in_the_run[0]
        assert min(in_the_run[1]) > max(times_ns)
        assert bench.run().outcome is RunOutcome.FAILED
        assert "view2" in bench.acquisition.status().message
    bench.assert_next_run_is_sound()
    afterwards = frames_of(bench.reader())
    assert not (images | in_the_run[0]) & afterwards[0]
    assert min(afterwards[1]) > max(in_the_run[1])


@pytest.mark.parametrize("shots_before", [0, 2], ids=["between runs", "in a run"])
def test_a_camera_with_factory_settings_gets_its_profile_before_the_next_shot(
    bench: BenchServing, shots_before: int
) -> None:
    bench.assert_next_run_is_sound()
    assert settings(bench) == OURS
    if shots_before:
        bench.start(1000)
        bench.await_shots(shots_before)
    with bench.during("killed", view="view2"):
        if shots_before:
            assert "view2" in bench.end().message
    if shots_before:
        assert bench.acquisition.status().outcome is RunOutcome.FAILED
    assert settings(bench) == FACTORY
    bench.assert_next_run_is_sound()
    assert settings(bench) == OURS


def test_a_camera_that_was_without_power_for_a_moment_does_not_go_on_with_factory_settings(bench: BenchServing) -> None:
    bench.start(1000)
    bench.await_shots(2)
    bench.inject("power_cycled", view="view2", amount=0.05)
    status = bench.end()
    assert status.outcome is RunOutcome.FAILED
    assert "view2" in status.message
    assert all(bench.reader().read_shot(index).valid for index in range(bench.reader().shot_count))
    bench.assert_next_run_is_sound()


def test_lost_packets_cost_their_shots_and_no_others(bench: BenchServing) -> None:
    with bench.during("packet_loss", view="view2", amount=100):
        assert bench.run(2, refire_quota=0).shots_valid == 0
    bench.assert_next_run_is_sound()
