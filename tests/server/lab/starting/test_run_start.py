"""A run is not started with a calibration of images of another size."""

import json
from typing import Any

import pytest

from tests.support.memory_rig import SHAPE
from tests.support.serving import Serving, plan_of


def store(server: Serving, views: Any) -> None:
    path = server.services.data_dir / "calibrations" / "cal.json"
    path.write_text(json.dumps({"id": "cal", "views": views}))


def made_for(width_px: int, height_px: int) -> dict[str, Any]:
    return {"mapping": {"image_size_px": [width_px, height_px]}}


ROWS, COLUMNS = SHAPE


@pytest.mark.parametrize("named", [True, False])
def test_a_calibration_of_another_image_size_is_refused_at_the_start(server: Serving, named: bool) -> None:
    store(server, dict.fromkeys(("view1", "view2"), made_for(COLUMNS // 2, ROWS // 2)))
    if not named:
        server.app.state.context.calibrations.choose("cal")  # when the cameras were not binned yet
    answer = server.http.post("/api/runs", json=plan_of(**({"calibration": "cal"} if named else {})))
    assert answer.status_code == 422
    assert answer.json()["detail"].endswith("made for images of 64 x 48 px of view1, view2, not of 128 x 96 px")
    assert server.services.acquisition.status().run_id is None


@pytest.mark.parametrize(
    "views", [{}, None, {"view1": made_for(COLUMNS, ROWS)}, {"view1": 3}, {"other": made_for(1, 1)}]
)
def test_a_calibration_that_fits_or_does_not_say_is_taken(server: Serving, views: Any) -> None:
    store(server, views)
    _, status = server.run_to_its_end(plan_of(calibration="cal"))
    assert status.outcome == "completed"
