"""Where the numbers of a report come from: what a reader needs to repeat them."""

import json
from typing import Any

import numpy as np

from processing.runs.sprays.measured_spray import MeasuredSpray
from server.reports.origin_section import origin_of
from tests.support.sampled_sprays import stored_shot


def rows(*told: dict[str, Any]) -> dict[str, str]:
    shots = tuple(stored_shot(np.array([20.0, 30.0]), shot=number, **one) for number, one in enumerate(told))
    (table,) = origin_of(MeasuredSpray("monday", shots, None), None, None).tables
    return dict(table.rows)  # type: ignore[arg-type]


def velocity(separation_ns: float, source: str) -> dict[str, str]:
    return {"velocity": json.dumps({"separation_ns": separation_ns, "separation_source": source})}


def test_views_voxel_and_separation_are_told_each_once() -> None:
    views = {"exposures": json.dumps({frame: {"views": {"left": {}, "right": {}}} for frame in "ab"})}
    alike = {**velocity(6400.0, "fired"), **views}
    found = rows(alike, alike)
    assert (found["from A to B [µs]"], found["views"], found["voxel [µm]"]) == ("6.4, as fired", "left, right", "100")
    assert rows(alike, velocity(12800.0, "stated"))["from A to B [µs]"] == "6.4, as fired and 12.8, as stated"


def test_what_is_not_known_has_no_row() -> None:
    found = rows({}, {"velocity": "null"}, {"velocity": json.dumps({"reason": "shots have one exposure"})})
    assert not {"from A to B [µs]", "views", "box [mm]"} & set(found)
    assert found["nozzle and axis"] == "not known"
