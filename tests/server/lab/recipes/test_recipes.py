"""What is made of every shot by itself is what the plan of its run states, and the run says it with its hash."""

import re
from pathlib import Path
from typing import Any

import pytest

from daq.recipe import Recipe
from daq.run.refusals import RefusalCode
from processing.calibration.calibration_file import load_calibration
from processing.reconstruction.settings import METHOD_VERSION, GridSettings, ReconstructionSettings
from processing.runs.droplets.measure_settings import MeasureSettings
from processing.runs.recipe import recipe_sha256
from processing.runs.stated_grid import parse_grid
from server.lab.errors import Unprocessable
from server.lab.recipes.stated import settings_of, spelled_out, told_recipes
from tests.server.web.test_api import use_a_calibration
from tests.support.live_shots import save_droplet_calibration
from tests.support.server_process import eventually
from tests.support.serving import Serving, plan_of

SMART = {"command": "reconstruct", "settings": {"method": "smart", "iterations": 5}}
BOX = "-1:1,-0.5:0.5,-1:1"


def made_of(server: Serving, run_id: str) -> dict[str, Any]:
    """Settings of what was made of the only shot of a run, by kind."""
    jobs = server.http.get("/api/jobs", params={"run_id": run_id}).json()
    return {job["kind"]: job["settings"] for job in jobs if job["kind"] != "check"}


def stated_by(server: Serving, run_id: str) -> Any:
    return server.http.get(f"/api/runs/{run_id}/header").json()["plan"]["recipes"]


def test_what_a_plan_states_is_made_of_its_shots_and_stands_in_the_run_with_its_hash(server: Serving) -> None:
    use_a_calibration(server)
    background, _ = server.run_to_its_end(plan_of(kind="background", shots=1))
    plan = plan_of(shots=1, references=[background], recipes=[SMART, {"command": "measure"}])
    run_id, _ = server.run_to_its_end(plan)
    settings = ReconstructionSettings.model_validate(SMART["settings"])
    measured = MeasureSettings(polarity="shadow").model_dump(mode="json")
    eventually(lambda: len(made_of(server, run_id)) == 2, "both are queued")
    assert made_of(server, run_id) == {"reconstruction": settings.model_dump(mode="json"), "measurement": measured}
    volumes, droplets = stated_by(server, run_id)
    assert volumes["settings"] == settings.model_dump(mode="json")
    assert volumes["sha256"] == recipe_sha256("reconstruct", METHOD_VERSION, settings)
    assert droplets["settings"] == measured


def test_the_box_that_a_plan_states_has_the_pixels_of_its_calibration(server: Serving, tmp_path: Path) -> None:
    calibration = server.services.data_dir / "calibrations" / "cal.json"
    save_droplet_calibration(calibration)
    measure = Recipe(command="measure", settings={"grid": BOX})
    stated = spelled_out(measure, calibration)
    grid = GridSettings.of(parse_grid(BOX, load_calibration(calibration)))
    assert settings_of(stated) == MeasureSettings(polarity="shadow", grid=grid)
    assert spelled_out(stated) == stated
    background, _ = server.run_to_its_end(plan_of(kind="background", shots=1))
    plan = plan_of(references=[background], calibration="cal", recipes=[measure.model_dump()])
    checks = server.http.post("/api/rig/readiness", json=plan).json()["checks"]
    (recipe,) = (check["text"] for check in checks if check["name"] == "Recipe")
    assert re.match(r"droplets in the box -1:1,-0\.5:0\.\d+,-1:1 mm ", recipe), recipe


@pytest.mark.parametrize(
    ("box", "calibration", "text"),
    [
        ("0:1", "cal.json", "'0:1' is not of the form X0:X1,Y0:Y1,Z0:Z1"),
        ("1:0,0:1,0:1", "cal.json", "every range must grow"),
        (BOX, "gone.json", "gone.json"),
        (BOX, "", "none is chosen"),
    ],
)
def test_a_box_without_sense_or_calibration_is_refused(tmp_path: Path, box: str, calibration: str, text: str) -> None:
    save_droplet_calibration(tmp_path / "cal.json")
    with pytest.raises(Unprocessable, match=re.escape(text)) as refused:
        spelled_out(Recipe(command="measure", settings={"grid": box}), tmp_path / calibration if calibration else None)
    assert refused.value.code == RefusalCode.RECIPE


def test_without_a_box_all_that_the_views_see_is_told() -> None:
    assert told_recipes((spelled_out(Recipe(command="measure")),)).startswith("droplets in all that the views see ")


def test_where_a_plan_states_nothing_the_usual_is_made_and_stated(server: Serving) -> None:
    use_a_calibration(server)
    run_id, _ = server.run_to_its_end(plan_of(shots=1))
    (usual,) = stated_by(server, run_id)
    eventually(lambda: bool(made_of(server, run_id)), "it is queued")
    assert made_of(server, run_id) == {"reconstruction": usual["settings"]}
    assert usual["settings"] == server.services.settings.model_dump(mode="json")


def test_where_a_plan_states_that_nothing_is_made_nothing_is(server: Serving) -> None:
    use_a_calibration(server)
    nothing, _ = server.run_to_its_end(plan_of(shots=1, recipes=[]))
    usual, _ = server.run_to_its_end(plan_of(shots=1))
    eventually(lambda: bool(made_of(server, usual)), "what came later is queued")
    assert made_of(server, nothing) == {}


def test_a_calibration_that_is_chosen_later_makes_nothing_of_a_run_that_began_without(server: Serving) -> None:
    run_id = server.http.post("/api/runs", json=plan_of(shots=6, rate_hz=4)).headers["location"].rsplit("/", 1)[-1]
    use_a_calibration(server)
    server.wait()
    usual, _ = server.run_to_its_end(plan_of(shots=1))
    eventually(lambda: bool(made_of(server, usual)), "what came later is queued")
    assert made_of(server, run_id) == {}


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"recipes": [{"command": "reconstruct", "settings": {"methd": "smart"}}]}, "reconstruct: methd: "),
        ({"recipes": [{"command": "reconstruct", "settings": {"iterations": 2.5}}]}, "iterations: .*integer"),
        ({"recipes": [SMART | {"sha256": "0" * 64}]}, "and what it states has"),
        ({"recipes": [{"command": "measure", "settings": {"polarity": "bright"}}]}, "recorded as shadow"),
        ({"recipes": [{"command": "measure"}]}, "against a background run, and none is among the references"),
        ({"kind": "dark", "recipes": [SMART]}, "nothing is made of a dark run"),
    ],
)
def test_a_recipe_that_cannot_be_followed_is_refused(server: Serving, changes: dict[str, Any], text: str) -> None:
    answer = server.http.post("/api/runs", json=plan_of(**changes)).json()
    assert answer["code"] == "recipe"
    assert re.search(text, answer["detail"]), answer
