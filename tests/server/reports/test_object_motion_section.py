"""The chapter on how ligaments and sheets move: how many have a velocity, how fast, how sure, why others have none."""

from typing import Any

import numpy as np

from processing.analysis.droplets.droplet_file import StoredDroplets
from server.reports.object_motion_section import object_motion_section


def shot(speeds_m_s: list[float], reasons: list[str]) -> StoredDroplets:
    """Ligaments along y, one exposure each in turn, without a velocity where the speed is not a number."""
    n = len(speeds_m_s)
    objects: dict[str, Any] = {"frame": np.resize(["a", "b"], n), "class": np.full(n, "ligament")}
    objects |= {f"{axis}_mm": np.linspace(-1, 1, n) for axis in "xyz"} | {"length_mm": np.linspace(0.3, 0.9, n)}
    objects |= {"u_m_s": np.zeros(n) * speeds_m_s, "v_m_s": np.array(speeds_m_s), "w_m_s": np.zeros(n) * speeds_m_s}
    objects |= {f"{name}_sd_m_s": np.full(n, 0.1) * (np.array(speeds_m_s) * 0 + 1) for name in "uvw"}
    return StoredDroplets({}, {}, objects | {"velocity_reason": np.array(reasons)})


def test_velocities_are_told_with_their_deviations_and_reasons_counted() -> None:
    nan = float("nan")
    section = object_motion_section([shot([20.0, 22.0, nan], ["", "", "too far"]), shot([24.0, nan], ["", "too far"])])
    assert section
    (table,) = section.tables
    assert table.rows[0] == ["ligaments", "3", "5", "22.00", "20.40 to 23.60", "0.100"]
    assert table.rows[1] == ["sheets", "0", "0", "", "", ""]
    assert list(section.points) == ["2 without a velocity: too far"]
    (picture,) = section.pictures
    places, speeds = picture.figure.axes
    assert len(places.collections) == 2
    assert len(speeds.containers) == 1


def test_without_velocities_there_is_no_picture_and_without_objects_no_chapter() -> None:
    section = object_motion_section([shot([float("nan")], ["hidden"])])
    assert section
    assert not section.pictures
    assert object_motion_section([StoredDroplets({}, {}), shot([], [])]) is None
