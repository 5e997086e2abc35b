"""The soaks of ``make soak`` at reduced length, and what they would find."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from daq.faults import FaultKind
from daq.files.run_directory import DoubleFrame, ExposureRecord, FiredTrain, ImageKey, RunReader, Shot
from daq.run.limits import AcquisitionLimits
from processing.benchmarks.scene import SpeedStudy
from processing.synthetic.numbered import ImageNumber, numbered
from server.cli.benchmarks.recorded_run import record_run
from tests.support import soak_cluster, soak_faults, soak_light, soak_long, soak_workers
from tests.support.simulated_serving import serving_bench, tiny_config
from tests.support.soak_kill import Killed, kill_servers, mispaired_exposures, summary
from tests.support.watched_rig import Darkness

VIEWS = ("view1", "view2")


@pytest.mark.network
@pytest.mark.slow
@pytest.mark.timeout(600)
def test_no_acknowledged_shot_is_lost_when_the_server_is_killed(tmp_path: Path) -> None:
    kills: list[Killed] = []
    kill_servers(2, tmp_path, "here", kills.append)
    for kill in kills:
        assert 0 < kill.acknowledged <= kill.on_disk, kills
        assert (kill.lost, kill.mispaired) == (0, 0), kills
    assert [kill.outcome for kill in kills] == ["interrupted", ""]
    assert kills[0].first_shot_s is None
    assert kills[1].first_shot_s is not None


def shot() -> Shot:
    views = {}
    for number, view in enumerate(VIEWS):
        a, b = (numbered(np.zeros((24, 32), np.uint8), ImageNumber(7, number, frame), 8) for frame in ("A", "B"))
        views[view] = DoubleFrame(a, b, ExposureRecord(True, 1), ExposureRecord(True, 2))
    return Shot(0, ImageKey.BACKGROUND, views, FiredTrain(7))


def test_exposures_of_another_view_firing_or_pulse_are_found() -> None:
    right = shot()
    assert mispaired_exposures(right, VIEWS) == 0
    assert mispaired_exposures(replace(right, fired=FiredTrain(8)), VIEWS) == 4
    assert mispaired_exposures(replace(right, fired=None), VIEWS) == 4
    one, other = right.views.values()
    assert mispaired_exposures(replace(right, views={"view1": other, "view2": one}), VIEWS) == 4
    assert one.frame_b is not None
    swapped = replace(one, frame_a=one.frame_b, frame_b=one.frame_a)
    assert mispaired_exposures(replace(right, views={"view1": swapped, "view2": other}), VIEWS) == 2
    damaged = replace(one, frame_a=255 - one.frame_a)
    assert mispaired_exposures(replace(right, views={"view1": damaged, "view2": other}), VIEWS) == 1
    flagged = replace(damaged, record_a=ExposureRecord(False))
    assert mispaired_exposures(replace(right, views={"view1": flagged, "view2": other}), VIEWS) == 0


def test_the_table_counts_all_kills() -> None:
    kills = [Killed("abc", 10, 11, 1, 2, None, "interrupted", 1.0), Killed("abc", 5, 5, 0, 0, 3.25, "", 2.0)]
    heads, row, origin = summary(kills).splitlines()
    assert heads.split()[0] == "kills"
    assert row.split() == ["2", "15", "1", "2", "0", "3.2", "3.2", "1", "to", "2"]
    assert origin.startswith("commit abc; ")


@pytest.mark.network
@pytest.mark.slow
def test_after_a_camera_was_without_power_the_next_run_is_completed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(soak_faults, "FAULTS", {"killed": {"view": "view2"}})
    with serving_bench(tiny_config(tmp_path / "runs", subnet=9)) as bench:
        sound, returned = soak_faults.lose_devices(bench, 1)
    assert (sound.fault, sound.refused, sound.failed) == ("", 0, 0)
    assert returned.fault == "killed"
    assert returned.next_run_s > 0


@pytest.mark.network
@pytest.mark.slow
@pytest.mark.timeout(600)
def test_runs_through_one_server_lose_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    runs: list[soak_long.Recorded] = []
    monkeypatch.setattr(soak_long, "SHOTS", 5)
    soak_long.record_runs(8, tmp_path, "here", runs.append)
    assert [(run.planned, run.told, run.valid, run.lost, run.mispaired) for run in runs] == [
        (5, 5, 5, 0, 0),
        (3, 3, 3, 0, 0),
    ]
    assert all(run.rss_kib for run in runs)
    assert min(shots for shots, _ in runs[1].rss_kib) >= 5


def test_memory_that_grows_with_every_shot_is_found_after_the_warm_up() -> None:
    def run(server: int, *samples: tuple[int, float]) -> soak_long.Recorded:
        return soak_long.Recorded("abc", server, 500, 500, 499, 0, 1, samples, 2.0)

    growing = [run(7, (0, 1e5), (2500, 2e5), (2800, 2e5 + 300)), run(7, (3100, 2e5 + 600)), run(8, (2500, 1.0))]
    assert soak_long.slope_bytes(growing) == pytest.approx(1024)
    assert soak_long.slope_bytes(growing[2:]) is None
    heads, row, origin = soak_long.summary(growing).splitlines()
    assert heads.split()[:5] == ["runs", "shots", "told", "valid", "lost"]
    assert row.split()[:7] == ["3", "1500", "1500", "1497", "0", "3", "1024"]
    assert origin.startswith("commit abc; ")


def test_the_table_of_faults_counts_what_was_refused() -> None:
    found = [soak_faults.Returned(name, 2.0, 1, 2, 0.5) for name in ("", *soak_faults.FAULTS)]
    heads, *rows, origin = soak_faults.summary([*found, soak_faults.Returned("", 4.0, 0, 0, 1.5)]).splitlines()
    assert heads.startswith("lost between runs")
    assert rows[0].split() == ["(none)", "2", "3.0", "4.0", "1", "2"]
    assert [row.split()[0] for row in rows[1:]] == list(soak_faults.FAULTS)
    assert origin.endswith("load 0.5 to 1.5")


@pytest.mark.network
@pytest.mark.slow
def test_a_fault_that_ends_a_run_and_one_that_does_not_are_told_apart(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found: list[soak_light.Darkened] = []
    monkeypatch.setattr(soak_light, "KINDS", [FaultKind.DROPPED_A, FaultKind.ESTOP_PRESSED])
    monkeypatch.setattr(soak_light, "LIMIT_S", 1.0)
    # on a busy machine cameras are slow to re-base and to send, and the light goes off while they do
    monkeypatch.setattr(soak_light, "LIMITS", AcquisitionLimits(frame_s=5.0, patience_s=5.0))
    soak_light.try_all(tmp_path, 1, found.append)
    assert found[0].darkness is None
    assert found[1].darkness is not None
    assert found[1].darkness.confirmed_s is not None
    assert found[1].darkness.asked_before == ()


def test_the_table_of_darkness_tells_what_was_never_confirmed() -> None:
    def told(kind: FaultKind, *darkness: Darkness | None) -> list[soak_light.Darkened]:
        return [soak_light.Darkened(kind, one, 0.5) for one in darkness]

    hang, door = FaultKind.GENERATOR_HANG, FaultKind.INTERLOCK_OPEN
    found = told(hang, Darkness(0.0, None, ())) + told(FaultKind.LATE, None)
    found += told(door, Darkness(0.004, 0.002, ()), Darkness(0.0, 0.003, ()))
    _, *rows, calm, machine = soak_light.summary(found).splitlines()
    assert [row.split() for row in rows] == [
        ["generator_hang", "1", "0.0", "0.0", "0.0", "-", "-", "-", "1"],
        ["interlock_open", "2", "2.0", "4.0", "4.0", "2.5", "3.0", "3.0", "0"],
        ["all", "3", "0.0", "3.9", "4.0", "2.5", "3.0", "3.0", "1"],
    ]
    assert calm == "the run went on with the light: late"
    assert machine.endswith("load 0.5 to 0.5")


def test_the_table_of_a_cluster_counts_lost_shots() -> None:
    found = [soak_cluster.Fault(name, 0, 1, 2.0, 0.5) for name in soak_cluster.FAULTS]
    found.append(soak_cluster.Fault("", 3, 0, 4.0, 1.5))
    heads, *rows, origin = soak_cluster.summary(found).splitlines()
    assert heads.startswith("what happens")
    assert rows[0].split() == ["(none)", "2", "32", "3", "1", "4.0"]
    assert rows[1].split()[-5:] == ["1", "16", "0", "1", "2.0"]
    assert origin.endswith("load 0.5 to 1.5")


def test_few_sprays_are_recorded_in_ever_new_pairs(tmp_path: Path) -> None:
    study = SpeedStudy(shape=(9, 18, 18), image_size_px=(64, 48), droplets=20)
    run = RunReader(record_run(tmp_path, study, 6, sprays=3).run_dir)
    shots = [run.read_shot(index).views["view1"] for index in range(6)]
    pairs = {(shot.frame_a.tobytes(), shot.frame_b.tobytes()) for shot in shots if shot.frame_b is not None}
    assert len(pairs) == 6
    assert len({image for pair in pairs for image in pair}) == 3
    assert all(first != second for first, second in pairs)


def test_the_table_of_workers_tells_how_busy_they_were() -> None:
    done = [soak_workers.Done("1 workers", 10.0, 9.5, 1.0), soak_workers.Done("2 workers", 5.0, 9.5, 2.0)]
    heads, one, two, told = soak_workers.summary(done, 4, same=False).splitlines()
    assert heads.split()[-1] == "load"
    assert one.split() == ["1", "workers", "4", "10.0", "9.5", "0.95", "1.00", "2.38", "1.0"]
    assert two.split()[2:7] == ["4", "5.0", "9.5", "1.90", "2.00"]
    assert told.startswith("volumes are NOT the same bit by bit")
