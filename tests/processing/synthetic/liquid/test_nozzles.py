"""The paper's sprays: seeded, of the right angle, speed, size and flow, and whole within the images."""

from collections.abc import Callable

import numpy as np
import pytest

from processing.synthetic.liquid.breakup import perforate, sheet_film
from processing.synthetic.liquid.nozzles import FLAT_FAN_FLOW, HOLLOW_CONE_FLOW, flat_fan_spray, hollow_cone_spray
from processing.synthetic.liquid.sheet import FlatFan, Sheet
from processing.synthetic.paper_rig import paper_cameras
from processing.synthetic.spray import LiquidKind, Spray
from processing.synthetic.stamping import FloatArray

BOTH = pytest.mark.parametrize("factory", [hollow_cone_spray, flat_fan_spray])


def from_orifice_mm(spray: Spray) -> FloatArray:
    return spray.positions_mm - HOLLOW_CONE_FLOW.orifice_mm


@BOTH
def test_equal_seeds_give_equal_sprays(factory: Callable[[list[int]], Spray]) -> None:
    np.testing.assert_array_equal(factory([3, 1]).positions_mm, factory([3, 1]).positions_mm)
    assert not np.array_equal(factory([3, 1]).positions_mm[:50], factory([3, 2]).positions_mm[:50])


@BOTH
def test_sheet_ligaments_droplets_follow_each_other_downstream(factory: Callable[[int], Spray]) -> None:
    spray = factory(0)
    depth_mm = [np.median(spray.of_kind(kind).positions_mm[:, 1]) for kind in (LiquidKind.SHEET, LiquidKind.LIGAMENT)]
    assert depth_mm[0] < depth_mm[1] < np.median(spray.of_kind(LiquidKind.DROPLET).positions_mm[:, 1])


@BOTH
def test_everything_flies_down_and_away_at_the_speed_of_the_sheet(factory: Callable[[int], Spray]) -> None:
    spray = factory(0)
    velocities = spray.velocities_mm_per_s
    assert velocities[:, 1].min() > 5_000
    speeds = np.linalg.norm(velocities, axis=1)
    assert 18_000 < np.median(speeds[spray.kinds == LiquidKind.DROPLET]) < 30_000
    rays = from_orifice_mm(spray)
    along = np.einsum("ij,ij->i", rays, velocities) / np.linalg.norm(rays, axis=1) / speeds
    assert np.percentile(along, 2) > 0.9


def test_cone_opens_by_63_degrees_around_y() -> None:
    rays = from_orifice_mm(hollow_cone_spray(1).of_kind(LiquidKind.DROPLET))
    opening_deg = 2 * np.degrees(np.arctan2(np.hypot(rays[:, 0], rays[:, 2]), rays[:, 1]))
    assert np.median(opening_deg) == pytest.approx(63, abs=1)
    assert abs(np.mean(np.sign(rays[:, 0]))) < 0.06
    assert abs(np.mean(np.sign(rays[:, 2]))) < 0.06


def test_cone_is_hollow_at_25_orifice_diameters() -> None:
    rays = from_orifice_mm(hollow_cone_spray(2))
    slice_radii_mm = np.hypot(rays[:, 0], rays[:, 2])[np.abs(rays[:, 1] - 5.0) < 0.3]
    assert len(slice_radii_mm) > 50
    assert np.median(slice_radii_mm) == pytest.approx(5 * np.tan(np.radians(31.5)), rel=0.1)
    assert np.mean(slice_radii_mm < 1.5) < 0.01


def test_fan_is_wide_in_x_and_thin_in_z() -> None:
    rays = from_orifice_mm(flat_fan_spray(1).of_kind(LiquidKind.DROPLET))
    angles_deg = np.degrees(np.arctan2(rays[:, 0], rays[:, 1]))
    assert 30 < np.percentile(np.abs(angles_deg), 98) < 34
    assert np.median(np.abs(rays[:, 2]) / rays[:, 1]) < 0.06


def test_fan_sheet_is_perforated() -> None:
    rng = np.random.default_rng(5)
    sheet = Sheet(FlatFan(np.deg2rad(65)), FLAT_FAN_FLOW, rng)
    film = sheet_film(sheet, rng)
    pierced, rims = perforate(sheet, film, rng)
    assert 0.7 * len(film) < len(pierced) < 0.98 * len(film)
    assert len(rims) > 20 * FLAT_FAN_FLOW.holes


def test_droplets_are_log_normal_and_carry_the_flow_of_the_nozzle() -> None:
    flow = HOLLOW_CONE_FLOW
    drops = hollow_cone_spray(4).of_kind(LiquidKind.DROPLET)
    assert np.median(drops.diameters_mm) == pytest.approx(flow.median_diameter_mm, rel=0.05)
    assert np.std(np.log(drops.diameters_mm)) == pytest.approx(flow.diameter_spread, rel=0.1)
    distance_mm = from_orifice_mm(drops)[:, 1]
    band = (distance_mm > 8) & (distance_mm < 16)
    volume_mm3 = np.pi / 6 * drops.diameters_mm[band] ** 3
    carried_mm3_per_s = np.sum(volume_mm3 * drops.velocities_mm_per_s[band, 1]) / 8
    ideal_mm3_per_s = np.pi / 4 * flow.orifice_diameter_mm**2 * np.sqrt(2 * 6e5 / 998) * 1000
    assert 0.2 < carried_mm3_per_s / ideal_mm3_per_s < 0.6


@BOTH
def test_every_view_sees_the_orifice_and_nearly_all_liquid(factory: Callable[[int], Spray]) -> None:
    spray = factory(0)
    for camera in paper_cameras().values():
        inside = np.all(
            (camera.project(spray.positions_mm) > 0) & (camera.project(spray.positions_mm) < camera.image_size_px),
            axis=1,
        )
        assert inside.mean() > 0.97
