"""What is made of every shot by itself is what the plan of its run states, and the run says it with its hash."""

import re
from typing import Any

import pytest

from processing.reconstruction.settings import METHOD_VERSION, ReconstructionSettings
from processing.runs.measurement import MeasureSettings
from processing.runs.recipe import recipe_sha256
from tests.server.web.test_api import use_a_calibration
from tests.support.server_process import eventually
from tests.support.serving import Serving, plan_of

SMART = {"command": "reconstruct", "settings": {"method": "smart", "iterations": 5}}


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
