"""Droplets by the server: asked for, measured from images alone, listed, downloaded, and found again."""

import json
import re
import shutil
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import httpx
import pytest
from fastapi import FastAPI

from processing.analysis.droplets.droplet_file import DropletFileError, read_droplets
from processing.analysis.droplets.droplet_search import DropletSearch, plan_droplets
from processing.calibration.calibration_file import load_calibration, save_calibration
from processing.calibration.calibration_record import content_id
from processing.runs.droplets.measure_settings import MeasureSettings
from processing.runs.errors import Stopped
from processing.runs.sprays.measured_spray import read_spray
from server.lab.droplets.measured import measured_run
from server.lab.droplets.measurement import settings_within
from server.lab.errors import Unprocessable
from server.lab.events import EventPublisher
from server.lab.jobs.job import JobKind, JobState
from server.lab.jobs.job_recovery import jobs_on_disk
from server.lab.services import Services
from server.lab.tasks import measure_shot
from server.web.app import create_api
from server.web.ui.drawer.job_panel import job_row
from server.web.ui.results.droplet_panel import droplet_row, told_shots
from tests.server.web.test_api import wait_for_jobs
from tests.support.bright_scenes import GRID, MARGIN_VOXEL, write_bright_calibration, write_bright_run
from tests.support.droplet_run import write_run
from tests.support.serving import Serving, serving

SETTINGS = MeasureSettings.model_validate(
    {
        "grid": {"shape": GRID.shape, "origin_mm": GRID.origin_mm, "pitch_mm": GRID.pitch_mm},
        "margin_voxel": MARGIN_VOXEL,
    }
)
REQUEST = {"run_id": "bright", "calibration": "cal", "settings": SETTINGS.model_dump(mode="json")}


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A data directory with a bright run of two shots, both measured, and one of shadows."""
    data_dir = tmp_path_factory.mktemp("lab") / "runs"
    write_bright_run(data_dir / "bright", shots=2)
    write_run(data_dir / "shadows")
    (data_dir / "calibrations").mkdir()
    write_bright_calibration(data_dir / "calibrations" / "cal.json")
    with serving(data_dir, build=build) as server:
        assert ask(server).status_code == 202
        wait_for_jobs(server, 2, "measurement")
    return data_dir


def build(services: Services) -> FastAPI:
    return create_api(replace(services, tasks={**services.tasks, JobKind.MEASUREMENT: measure_shot}))


@pytest.fixture
def measured(kept: Path, tmp_path: Path) -> Iterator[Serving]:
    """A server for every test, on a copy of that directory."""
    with serving(shutil.copytree(kept, tmp_path / "runs"), build=build) as server:
        yield server


def ask(server: Serving, **changes: Any) -> httpx.Response:
    return server.http.post("/api/jobs/measurements", json={**REQUEST, **changes})


def results_of(server: Serving) -> tuple[str, dict[str, Any]]:
    """Address of the droplets, and their result set."""
    (result_set,) = server.http.get("/api/runs/bright/results").json()
    return f"/api/runs/bright/results/{result_set['id']}/droplets", result_set


def test_a_job_per_shot_measures_without_any_volume(measured: Serving) -> None:
    jobs = measured.http.get("/api/jobs", params={"kind": "measurement"}).json()
    assert [(job["shot"], job["state"]) for job in jobs] == [(1, "done"), (0, "done")]
    assert {job["results_id"] for job in jobs} == {SETTINGS.results_id("cal")}
    _, result_set = results_of(measured)
    assert [(droplets["name"], droplets["shot"]) for droplets in result_set["droplets"]] == [
        ("shot_00000_droplets", 0),
        ("shot_00001_droplets", 1),
    ]
    assert result_set["volumes"] == []
    assert json.loads(result_set["provenance"]["settings"]) == SETTINGS.model_dump(mode="json")


def test_shots_and_statistics_are_told_and_files_downloaded(measured: Serving, tmp_path: Path) -> None:
    address, _ = results_of(measured)
    told = measured.http.get(address).json()
    assert [(shot["shot"], shot["verdict"]) for shot in told["shots"]] == [(0, "good"), (1, "good")]
    statistics = told["statistics"]
    assert statistics["n"] == sum(shot["droplets"] for shot in told["shots"])
    density = statistics["number_density_per_mm3"]
    assert density["low"] < 28 < density["high"]
    assert (statistics["d32_um"], statistics["reason"][:16]) == (None, "bright particles")
    assert told["velocity"]["pairs"] == 0
    assert "shots have one exposure" in told["velocity"]["reason"]
    unchecked = " ".join(one["what"] for one in told["together"]["not_checked"])
    assert "any gamma fits bright particles" in unchecked
    assert told["together"]["copies"] == ["bright, shot 1 has the very droplets of bright, shot 0: one is a copy"]
    path = tmp_path / "downloaded.h5"
    path.write_bytes(measured.http.get(f"{address}/1.h5").content)
    assert len(read_droplets(path).columns["x_mm"]) == told["shots"][1]["droplets"]
    assert measured.http.get(f"{address}/7.h5").status_code == 404
    assert measured.http.get(address.replace("droplets-", "mlos-")).status_code == 404


def test_a_run_tells_its_spray_from_the_shots_that_are_measured(measured: Serving) -> None:
    address, result_set = results_of(measured)
    told = measured.http.get("/api/runs/bright/statistics").json()
    assert (told["results"], told["shots"], told["measured"], told["recorded"]) == (result_set["id"], [0, 1], 2, 2)
    statistics = told["statistics"]
    assert statistics["sampling"] == "spatial"
    assert statistics["droplets"] == measured.http.get(address).json()["statistics"]
    assert "bright particles have no diameter" in statistics["reasons"]["fits"]
    missing = measured.http.get("/api/runs/shadows/statistics")
    assert missing.status_code == 404
    assert "measure some of its shots" in missing.json()["detail"]
    other = measured.http.get("/api/runs/bright/statistics", params={"results": "droplets-0"})
    assert (other.status_code, measured.http.get("/api/runs/none/statistics").status_code) == (404, 404)


def test_what_was_measured_is_measured_again_only_where_its_file_is_gone(measured: Serving) -> None:
    assert [job["state"] for job in ask(measured).json()] == ["done", "done"]
    lost = next(measured.services.data_dir.glob("bright/results/*/shot_00001_droplets.h5"))
    lost.unlink()
    done, again = ask(measured).json()
    assert done["state"] == "done"
    assert again["state"] in ("queued", "running")
    newest, _ = wait_for_jobs(measured, 2, "measurement")
    assert (newest["shot"], newest["state"], lost.is_file()) == (1, "done", True)


def test_measurements_are_found_again_when_the_table_of_jobs_is_lost(measured: Serving) -> None:
    found = {job.id: job for job in jobs_on_disk(measured.services.data_dir, EventPublisher())}
    jobs = measured.http.get("/api/jobs", params={"kind": "measurement"}).json()
    assert found.keys() == {job["id"] for job in jobs}
    assert {job.state for job in found.values()} == {JobState.DONE}
    for job in jobs:
        assert (found[job["id"]].kind, found[job["id"]].settings) == (JobKind.MEASUREMENT, job["settings"])


def test_what_cannot_be_measured_is_refused_with_its_reason(measured: Serving) -> None:
    for changes, status, text in (
        ({"run_id": "none"}, 404, "no run 'none'"),
        ({"calibration": "none"}, 404, "none"),
        ({"shots": [0, 5]}, 422, "has 2 shots, not [5]"),
        ({"shots": []}, 422, "at least 1 item"),
        ({"run_id": "shadows", "settings": None}, 422, "has no background, and without one nobody knows"),
        ({"run_id": "shadows"}, 422, "recorded as shadow, they are not measured as bright"),
        ({"settings": {"twinz": 1}}, 422, "twinz"),
        ({"settings": {"light": 0.8}}, 422, "light 0.8 is for shadows"),
        ({"settings": {"ignored": ["view1=0:9,0:9"]}}, 422, "pixels to ignore are for shadows"),
    ):
        answer = ask(measured, **changes)
        assert (answer.status_code, text in answer.text) == (status, True), answer.text


def test_a_damaged_file_is_named(measured: Serving) -> None:
    address, _ = results_of(measured)
    path = next(measured.services.data_dir.glob("bright/results/*/shot_00000_droplets.h5"))
    path.write_bytes(path.read_bytes()[:1000])
    answer = measured.http.get(address)
    assert answer.status_code == 500
    assert "shot_00000_droplets.h5: not a readable file of droplets" in answer.json()["detail"]


def edit(column: str, change: Callable[[Any], Any], *, old: bool = False) -> Callable[[Path], None]:
    """Change a column of the first shot, in the file of an older program where there was no seal."""

    def spoil(results: Path) -> None:
        with h5py.File(results / "shot_00000_droplets.h5", "r+") as file:
            values = file[f"droplets/{column}"]
            values[:] = change(values[:])
            if old:
                del file["tomoshadow"].attrs["seal_sha256"]

    return spoil


def exchange(results: Path) -> None:
    (results / "shot_00000_droplets.h5").replace(results / "shot_00001_droplets.h5")


def bring_to_another_run(results: Path) -> None:
    write_run(results.parents[1].with_name("other"))
    results.parents[1].joinpath("run.h5").write_bytes((results.parents[2] / "other" / "run.h5").read_bytes())


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (edit("x_mm", lambda x_mm: x_mm + 0.01), "was changed after it had been measured"),
        (edit("x_mm", lambda x_mm: x_mm + 100, old=True), r"droplets have x_mm outside of .* mm, where they were"),
        (edit("amplitude", lambda amplitude: amplitude / 2), "was changed after it had been measured"),
        (exchange, "was renamed, it holds the droplets of shot 0"),
        (bring_to_another_run, "holds droplets of run bright and lies in run other"),
    ],
)
def test_droplets_that_are_not_those_that_were_measured_are_refused(
    measured: Serving, tmp_path: Path, spoil: Callable[[Path], None], said: str
) -> None:
    run_dir = Path(shutil.copytree(measured.services.data_dir / "bright", tmp_path / "bright"))
    (results,) = (run_dir / "results").iterdir()
    assert len(read_spray([results]).shots) == 2
    spoil(results)
    with pytest.raises(DropletFileError, match=said):
        read_spray([results])


def test_droplets_are_told_although_the_run_around_them_cannot_be_read(measured: Serving) -> None:
    """They lie in files of their own, which are sound."""
    run_file, (address, _) = measured.services.data_dir / "bright" / "run.h5", results_of(measured)
    sound = measured.http.get(address).json()["together"]
    run_file.write_bytes(b"no HDF5")
    answer = measured.http.get(address)
    assert answer.status_code == 200, answer.text
    assert [shot["verdict"] for shot in answer.json()["shots"]] == ["good", "good"]
    (changed,) = (together := answer.json()["together"]).pop("conditions_changed")
    assert re.match(rf"whether run bright was changed later is not known: {run_file}: cannot be read", changed)
    assert (together, sound.pop("conditions_changed")) == (sound, [])


def test_the_page_tells_numbers_with_intervals_and_reasons(measured: Serving) -> None:
    results_dir = next(measured.services.data_dir.glob("bright/results/droplets-*"))
    row = droplet_row(measured_run(results_dir))
    assert row["droplets"].endswith("in 2 exposures of shots 0 to 1")
    assert [told_shots(shots) for shots in ([0, 1, 2], [4, 0, 2])] == ["shots 0 to 2", "3 shots from 0 to 4"]
    assert re.fullmatch(r"2\d(\.\d)? \(2\d(\.\d)? to 3\d(\.\d)?\)", row["density"])
    assert row["d32"].startswith("bright particles have no diameter")
    assert re.fullmatch(r"0\.\d\d \(0\.00 to \d\.\d\d\)", row["ghosts"])
    assert row["verdict"] == "2 good; bright, shot 1 has the very droplets of bright, shot 0: one is a copy"
    job, *_ = measured.http.get("/api/jobs", params={"kind": "measurement"}).json()
    known = next(job for job in jobs_on_disk(measured.services.data_dir, EventPublisher()))
    told = job_row(known.model_copy(update={"result": job["result"]}))
    assert told["job"] == "droplets of shot 0"
    assert (told["detail"], told["colour"]) == (f"{job['result']['droplets']} droplets, good", "positive")
    velocity = {"verdict": "doubtful", "reasons": ["two motions"]}
    told = job_row(known.model_copy(update={"result": {**job["result"], "velocity": velocity}}))
    assert told["detail"].endswith(" droplets, good; velocities doubtful; two motions")
    assert told["colour"] == "warning"


@pytest.mark.parametrize("before", [0, 3])
def test_a_measurement_can_be_aborted_in_any_round(measured: Serving, tmp_path: Path, before: int) -> None:
    data_dir = measured.services.data_dir
    job = {
        "run_dir": str(data_dir / "bright"),
        "shot": 0,
        "calibration_file": str(data_dir / "calibrations" / "cal.json"),
        "results_dir": str(tmp_path / "out"),
        "settings": REQUEST["settings"],
    }
    asked = iter([False] * before + [True])
    with pytest.raises(Stopped, match="shot 0: stopped in exposure a"):
        measure_shot(job, lambda: next(asked))
    assert not list((tmp_path / "out").glob("*.h5"))


def test_jobs_of_a_run_plan_once_until_settings_or_calibration_are_others(
    measured: Serving, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    planned: list[object] = []

    def counted(*given: Any, **more: Any) -> DropletSearch:
        planned.append(given)
        return plan_droplets(*given, **more)

    monkeypatch.setattr("processing.runs.droplets.measurement.plan_droplets", counted)
    calibration = write_bright_calibration(tmp_path / "cal.json")

    def plans_after(shot: int, seed: int, out: str) -> int:
        job = {
            "run_dir": str(measured.services.data_dir / "bright"),
            "shot": shot,
            "calibration_file": str(calibration),
            "results_dir": str(tmp_path / out),
            "settings": SETTINGS.model_copy(update={"seed": seed}).model_dump(mode="json"),
        }
        with pytest.raises(Stopped):
            measure_shot(job, lambda: True)
        return len(planned)

    assert [plans_after(shot, 0, "first") for shot in (0, 1)] == [1, 1]
    assert [plans_after(shot, 5, "second") for shot in (1, 0)] == [2, 2]
    anew = replace(load_calibration(calibration), notes=("made again",))
    save_calibration(anew.with_id(content_id(anew)), calibration, overwrite=True)
    assert plans_after(0, 5, "third") == 3


def test_what_was_measured_with_a_calibration_that_was_replaced_is_not_done(measured: Serving) -> None:
    file = measured.services.data_dir / "calibrations" / "cal.json"
    calibration = load_calibration(file)
    anew = replace(calibration, notes=("made again",))
    save_calibration(anew.with_id(content_id(anew)), file, overwrite=True)
    (job,) = ask(measured, shots=[0]).json()
    assert job["state"] in ("queued", "running")
    assert job["results_id"] != SETTINGS.results_id("cal")
    wait_for_jobs(measured, 3, "measurement")


def test_a_box_is_stated_as_on_the_command_line(measured: Serving) -> None:
    context = measured.app.state.context
    context.calibrations.choose("cal")
    settings = settings_within(context, "bright", " -1:1,-0.5:0.5,0:0.2@0.1 ")
    assert settings is not None
    assert settings.grid is not None
    assert (settings.grid.shape, settings.grid.origin_mm) == ((3, 11, 21), (-1, -0.5, 0))
    assert settings.polarity == "bright"
    assert settings_within(context, "bright", " ") is None


def test_a_box_of_another_form_is_told_by_its_name(measured: Serving) -> None:
    context = measured.app.state.context
    context.calibrations.choose("cal")
    with pytest.raises(Unprocessable, match="Box '1:2' is not of the form X0:X1,Y0:Y1,Z0:Z1"):
        settings_within(context, "bright", "1:2")
