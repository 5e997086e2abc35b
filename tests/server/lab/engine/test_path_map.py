"""What other computers call our folders."""

from pathlib import Path

import pytest

from server.lab.engine.path_map import PathMap, as_seen_by_workers


@pytest.mark.parametrize(
    ("here", "there"),
    [
        ("/data", "/mnt/lab"),
        ("/data/run 1", "/mnt/lab/run 1"),
        ("/data/fast/run", "/scratch/run"),
        ("/database/run", "/database/run"),
        ("/home/me/run", "/home/me/run"),
    ],
)
def test_the_longest_folder_that_fits_counts(here: str, there: str) -> None:
    assert PathMap({"/data": "/mnt/lab", "/data/fast": "/scratch"}).there(here) == there


def test_a_job_travels_with_the_paths_of_workers_and_the_folders_that_they_must_see(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    job = {"run_dir": "run", "calibration_file": "made/c.json", "results_dir": "out/a", "shot": 3}
    there, seen = as_seen_by_workers(PathMap({str(tmp_path): "/mnt"}), job)
    expected = {"run_dir": "/mnt/run", "calibration_file": "/mnt/made/c.json", "results_dir": "/mnt/out/a", "shot": 3}
    assert there == expected
    assert seen == {f"/mnt/{name}": f"{tmp_path}/{name}" for name in ("made", "out/a", "run")}
    assert (tmp_path / "out" / "a").is_dir()
    assert as_seen_by_workers(PathMap({}), {"results_dir": None, "shot": 3}) == ({"results_dir": None, "shot": 3}, {})
