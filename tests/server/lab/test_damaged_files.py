"""One damaged file harms nothing else, is told where the operator looks, and is never deleted."""

import json
import shutil
import sqlite3
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from daq.files.run_directory import RunReader, RunWriter, pack
from tests.server.web.test_api import use_a_calibration, wait_for_jobs
from tests.support.serving import Serving, plan_of, serving

SOUND = "20200101T000000-sound"


def damage_told(server: Serving) -> list[str]:
    return [str(event.data["reason"]) for event in server.services.events.since(0) if event.name == "file_damaged"]


def listed(server: Serving) -> dict[str, dict[str, Any]]:
    answer = server.http.get("/api/runs")
    assert answer.status_code == 200, answer.text
    return {run["run_id"]: run for run in answer.json()}


def garbage(run_dir: Path) -> None:
    (run_dir / "run.h5").write_bytes(b"nonsense" * 1000)


def cut(run_dir: Path) -> None:
    path = run_dir / "run.h5"
    path.write_bytes(path.read_bytes()[:3000])


def empty(run_dir: Path) -> None:
    (run_dir / "run.h5").write_bytes(b"")


def packed(run_dir: Path) -> None:
    pack(run_dir, run_dir.parent / "packed.h5")
    shutil.rmtree(run_dir / "shots")
    (run_dir.parent / "packed.h5").replace(run_dir / "run.h5")


def a_folder(run_dir: Path) -> None:
    (run_dir / "run.h5").unlink()
    (run_dir / "run.h5").mkdir()


@pytest.mark.parametrize("harm", [garbage, cut, empty])
def test_a_run_that_cannot_be_read_is_listed_as_damaged_beside_the_others(
    server: Serving, harm: Callable[[Path], None]
) -> None:
    use_a_calibration(server)
    sound, _ = server.run_to_its_end(plan_of(shots=1))
    bad = server.services.data_dir / "20200101T000000-bad"
    shutil.copytree(server.services.data_dir / sound, bad)
    harm(bad)
    runs = listed(server)
    assert (runs[sound]["outcome"], runs[sound]["shots_valid"]) == ("completed", 1)
    assert runs[bad.name]["outcome"] == "damaged"
    assert str(bad) in runs[bad.name]["cause"]
    assert runs[bad.name]["created_utc"].startswith("2020-01-01")
    assert server.http.get(f"/api/runs/{bad.name}").json() == runs[bad.name]
    refused = server.http.post("/api/jobs", json={"run_id": bad.name})
    assert (refused.status_code, refused.json()["type"]) == (500, "urn:tomoshadow:ShotFileError")


def test_a_run_that_was_packed_is_listed_as_such_and_not_reconstructed(server: Serving) -> None:
    use_a_calibration(server)
    sound, _ = server.run_to_its_end(plan_of(shots=1))
    bad = server.services.data_dir / "20200101T000000-bad"
    shutil.copytree(server.services.data_dir / sound, bad)
    packed(bad)
    told = listed(server)[bad.name]
    assert (told["outcome"], told["shots_recorded"], told["shots_valid"], told["name"]) == ("packed", 1, None, "test")
    assert server.http.get(f"/api/runs/{bad.name}").json() == told
    refused = server.http.post("/api/jobs", json={"run_id": bad.name})
    assert (refused.status_code, refused.json()["type"]) == (500, "urn:tomoshadow:ShotFileError")
    assert "copy its folder shots back" in refused.json()["detail"]


def test_a_folder_in_the_place_of_a_file_is_a_damaged_run(server: Serving) -> None:
    sound, _ = server.run_to_its_end(plan_of(shots=1))
    bad = server.services.data_dir / "bad"
    shutil.copytree(server.services.data_dir / sound, bad)
    a_folder(bad)
    assert listed(server)["bad"]["outcome"] == "damaged"


def test_a_run_that_vanishes_takes_nothing_with_it(server: Serving) -> None:
    use_a_calibration(server)
    gone, _ = server.run_to_its_end(plan_of(shots=1, name="gone"))
    wait_for_jobs(server, 1)
    shutil.rmtree(server.services.data_dir / gone)
    kept, _ = server.run_to_its_end(plan_of(shots=1, name="kept"))
    assert list(listed(server)) == [kept]
    assert server.http.get(f"/api/runs/{gone}").status_code == 404
    assert [job["state"] for job in wait_for_jobs(server, 2)] == ["done", "done"]


def test_runs_are_listed_by_their_own_time(server: Serving) -> None:
    data_dir = server.services.data_dir
    older, _ = server.run_to_its_end(plan_of(shots=1, name="older"))
    shutil.copytree(data_dir / older, data_dir / SOUND)
    (data_dir / older / "results").mkdir()
    assert list(listed(server)) == [older, SOUND]
    (data_dir / SOUND / "results").mkdir()
    assert list(listed(server)) == [older, SOUND]


def test_two_runs_of_the_same_second_are_listed_by_their_headers(server: Serving) -> None:
    data_dir = server.services.data_dir
    first, _ = server.run_to_its_end(plan_of(shots=1))
    with RunReader(data_dir / first) as run:
        header = run.header
    for name, second in [("a", "00.7"), ("b", "00.1"), ("c", "00.9"), ("d", "00.3")]:
        run_id = f"20990101T000000-{name}"
        created = f"2099-01-01T00:00:{second}+00:00"
        with RunWriter(data_dir / run_id, header.model_copy(update={"run_id": run_id, "created_utc": created})):
            pass
    assert [run_id[-1] for run_id in listed(server)][:4] == ["c", "a", "d", "b"]


TABLE_HARMS = {
    "garbage": lambda table: b"nonsense" * 2000,
    "truncated": lambda table: table[: len(table) // 2 // 4096 * 4096],
    "one page": lambda table: table[:4096],
    "half a page": lambda table: table[:2000],
    "zero bytes": lambda table: b"",
    "its pages overwritten": lambda table: table[:4096] + b"\x55" * (len(table) - 4096),
}


@pytest.mark.parametrize("harm", TABLE_HARMS.values(), ids=TABLE_HARMS.keys())
def test_a_damaged_table_of_jobs_is_kept_aside_and_found_again_in_the_files(
    tmp_path: Path, harm: Callable[[bytes], bytes]
) -> None:
    data_dir = tmp_path / "runs"
    with serving(data_dir) as server:
        use_a_calibration(server)
        server.run_to_its_end(plan_of(shots=3))
        before = {job["id"]: job["settings"] for job in wait_for_jobs(server, 3)}
    table = data_dir / "jobs.sqlite"
    with sqlite3.connect(table) as database:
        database.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    database.close()
    damaged = harm(table.read_bytes())
    table.write_bytes(damaged)
    with serving(data_dir) as server:
        answer = server.http.get("/api/jobs", params={"kind": "reconstruction"})
        assert answer.status_code == 200, answer.text
        assert {job["id"]: job["settings"] for job in answer.json() if job["state"] == "done"} == before
        (told,) = damage_told(server)
        (aside,) = data_dir.glob("jobs.sqlite.damaged-*")
        assert aside.name in told
        assert aside.read_bytes() == damaged
        server.run_to_its_end(plan_of(shots=1))
        assert len(wait_for_jobs(server, 4)) == 4


def test_a_sound_table_stays(tmp_path: Path) -> None:
    data_dir = tmp_path / "runs"
    for _ in range(2):
        with serving(data_dir) as server:
            assert damage_told(server) == []
    assert [path.name for path in data_dir.glob("jobs.sqlite*")] == ["jobs.sqlite"]


def test_half_written_settings_are_told_and_hide_no_other_results(tmp_path: Path) -> None:
    data_dir = tmp_path / "runs"
    with serving(data_dir) as server:
        use_a_calibration(server)
        run_id, _ = server.run_to_its_end(plan_of(shots=1))
        wait_for_jobs(server, 1)
        server.http.post("/api/jobs", json={"run_id": run_id, "settings": {"method": "minlos"}})
        wait_for_jobs(server, 2)
        torn, whole = sorted((data_dir / run_id / "results").iterdir())
        settings = torn / "settings.json"
        settings.write_text(settings.read_text()[:40])
        answer = server.http.get(f"/api/runs/{run_id}/results")
        assert answer.status_code == 200, answer.text
        results = {result["id"]: result for result in answer.json()}
        assert str(settings) in results[torn.name]["problem"]
        assert len(results[torn.name]["volumes"]) == 2
        assert results[whole.name]["problem"] is None
    (data_dir / "jobs.sqlite").unlink()
    with serving(data_dir) as server:
        assert [job["results_id"] for job in server.http.get("/api/jobs").json()] == [whole.name]
        assert ["settings.json" in str(event.data["file"]) for event in server.services.events.since(0)] == [True]


def test_a_deleted_volume_is_made_again_although_its_job_is_done(server: Serving) -> None:
    use_a_calibration(server)
    run_id, _ = server.run_to_its_end(plan_of(shots=1))
    (job,) = wait_for_jobs(server, 1)
    volume = server.services.data_dir / run_id / "results" / job["results_id"] / "shot_00000_b.vtkhdf"
    volume.unlink()
    shown = f"/api/runs/{run_id}/results/{job['results_id']}/shot_00000_b"
    assert server.http.get(shown).status_code == 200
    volume.with_suffix(".preview.npz").unlink()
    assert server.http.get(shown).status_code == 404
    (again,) = server.http.post("/api/jobs", json={"run_id": run_id}).json()
    assert again["id"] == job["id"]
    assert again["state"] in ("queued", "running")
    wait_for_jobs(server, 1)
    assert volume.is_file()
    (done,) = server.http.post("/api/jobs", json={"run_id": run_id}).json()
    assert done["state"] == "done"


def test_a_damaged_preview_is_made_again_and_a_damaged_volume_is_named(server: Serving) -> None:
    use_a_calibration(server)
    run_id, _ = server.run_to_its_end(plan_of(shots=1))
    (job,) = wait_for_jobs(server, 1)
    results_dir = server.services.data_dir / run_id / "results" / job["results_id"]
    (results_dir / "shot_00000_a.preview.npz").write_bytes(b"torn")
    answer = server.http.get(f"/api/runs/{run_id}/results/{job['results_id']}/shot_00000_a")
    assert (answer.status_code, answer.json()["type"]) == (500, "urn:tomoshadow:Damaged")
    assert "shot_00000_a.vtkhdf" in answer.json()["detail"]
    assert server.http.get(f"/api/runs/{run_id}/results/{job['results_id']}/shot_00000_b").status_code == 200


@pytest.mark.parametrize("content", [b"\xff\xfe\x00", b"../draft\n", b""])
def test_a_damaged_mark_of_the_current_calibration_harms_nothing(server: Serving, content: bytes) -> None:
    use_a_calibration(server)
    (server.services.data_dir / "calibrations" / "current").write_bytes(content)
    assert server.http.get("/api/calibrations").json() == [{"id": "cal", "current": False}]
    assert server.http.get("/api/rig").status_code == 200


def test_a_damaged_calibration_is_named_and_cannot_be_chosen(server: Serving) -> None:
    use_a_calibration(server)
    (server.services.data_dir / "calibrations" / "torn.json").write_text(json.dumps({"id": "torn"})[:5])
    for answer in (
        server.http.get("/api/calibrations/torn"),
        server.http.put("/api/calibrations/current", json={"id": "torn"}),
    ):
        assert (answer.status_code, answer.json()["type"]) == (500, "urn:tomoshadow:Damaged")
        assert "torn.json" in answer.json()["detail"]
    assert [item["id"] for item in server.http.get("/api/calibrations").json() if item["current"]] == ["cal"]
