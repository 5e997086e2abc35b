"""What is told of a calibration: verdict, worst plane, remedy, and why it cannot be used."""

import json
from pathlib import Path
from typing import Any

import pytest

from server.lab.calibration_story import refusals_of_use, story_of
from tests.support.serving import Serving

KEPT = Path(__file__).parents[2] / "fixtures" / "v0.1.0" / "runs" / "calibrations"


def stored(server: Serving, name: str, **changes: Any) -> dict[str, Any]:
    (path,) = KEPT.glob("*-target-polynomial.json")
    document: dict[str, Any] = json.loads(path.read_text())
    for view in document["views"].values():
        view.update(changes)
    (server.services.data_dir / "calibrations" / f"{name}.json").write_text(json.dumps(document))
    return document


def test_a_calibration_tells_its_views_its_worst_plane_and_what_to_do(server: Serving) -> None:
    document = stored(server, "old")
    first = next(iter(document["views"].values()))
    first["planes"][0]["mean_error_px"] = 9.5
    (server.services.data_dir / "calibrations" / "old.json").write_text(json.dumps(document))
    story = story_of(server.app.state.context, "old")
    name, view = next(iter(story.views.items()))
    assert (view.worst_plane, view.planes[0].mean_error_px) == ("z = -1.200 mm", 9.5)
    assert story.remedy == (
        f"record the target at z = -1.200 mm again: {name} misses it by 9.50 px on average, "
        "other planes by 0.02 px or less"
    )
    assert story.verdict == max(
        (one["verdict"] for one in document["views"].values()), key=["good", "usable", "warn", "refuse"].index
    )


def test_a_calibration_that_says_little_has_a_story_too(server: Serving) -> None:
    (server.services.data_dir / "calibrations" / "bare.json").write_text('{"id": "bare"}')
    story = story_of(server.app.state.context, "bare")
    assert (story.verdict, story.views, story.remedy) == (None, {}, "")


def test_a_refused_one_and_one_of_other_images_is_not_used(server: Serving) -> None:
    stored(server, "refused", verdict="refuse", reasons=["hold-out error 7 px"])
    reasons = refusals_of_use(server.app.state.context, "refused")
    assert "is refused: hold-out error 7 px" in reasons[0]
    answer = server.http.put("/api/calibrations/current", json={"id": "refused"})
    assert answer.status_code == 422
    assert answer.json()["detail"].startswith(reasons[0])
    assert answer.json()["code"] == "calibration_refused"
    assert "calibration_chosen" not in [event.name for event in server.services.events.since(0)]


def test_what_is_no_calibration_is_damaged(server: Serving) -> None:
    (server.services.data_dir / "calibrations" / "odd.json").write_text('{"views": {"view1": {"planes": 7}}}')
    assert server.http.get("/api/calibrations/odd/story").status_code == 500
    assert server.http.put("/api/calibrations/current", json={"id": "odd"}).status_code == 500


@pytest.mark.parametrize("name", ["errors.jpg", "nothing"])
def test_pictures_are_served_and_nothing_else(server: Serving, name: str) -> None:
    stored(server, "drawn")
    folder = server.services.data_dir / "calibrations" / "pictures" / "drawn"
    folder.mkdir(parents=True)
    (folder / "errors.png").write_bytes(b"\x89PNG")
    assert story_of(server.app.state.context, "drawn").pictures == ("errors",)
    answer = server.http.get("/api/calibrations/drawn/pictures/errors.png")
    assert (answer.status_code, answer.headers["content-type"]) == (200, "image/png")
    assert server.http.get(f"/api/calibrations/drawn/pictures/{name}.png").status_code == 404
