"""The spray as a whole, against formulas and by what must not change."""

import json
import operator
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from processing.analysis.droplets.droplet_file import StoredDroplets
from processing.analysis.estimates import Estimate
from processing.analysis.spray.spray_axis import SprayAxis
from processing.analysis.spray.spray_motion import AGAINST, ALL_ALIKE, NO_AXIS, NO_DENSITY, NO_VELOCITIES
from processing.analysis.spray.spray_statistics import AskedFor, SprayStatistics, spray_statistics
from processing.volume import VoxelGrid
from tests.support.sampled_sprays import BOX, cone_points_mm, cone_shots, in_box, stored_shot

DOWN = SprayAxis((0, 0, 0), (0, 2, 0))
ASKED = AskedFor(DOWN, liquid_kg_m3=1000.0)
DIAMETERS = ("d10_um", "d20_um", "d30_um", "d32_um", "d43_um", "dv10_um", "dv50_um", "dv90_um", "relative_span")


def value(estimate: Estimate | None) -> float:
    assert estimate
    return estimate.value


def figures(told: SprayStatistics) -> dict[str, float]:
    """Figures that a spray has, without intervals."""
    assert told.motion
    assert told.extent
    (pattern,) = told.patternations
    of_droplets = {name: value(getattr(told.droplets, name)) for name in DIAMETERS}
    return of_droplets | {
        "density": value(told.droplets.number_density_per_mm3),
        "ppm": value(told.liquid_ppm),
        "flux": value(told.motion.volume_flux_mm_s),
        "flux d32": value(told.motion.flux_d32_um),
        "speed": value(told.motion.speed_m_s),
        "axial": value(told.motion.axial_m_s),
        "correlation": value(told.motion.size_speed_correlation),
        "cone": value(told.extent.cone_angle_deg),
        "asymmetry": pattern.asymmetry or 0.0,
    }


@pytest.fixture(scope="module")
def cone() -> list[StoredDroplets]:
    return cone_shots()


@pytest.fixture(scope="module")
def told(cone: list[StoredDroplets]) -> SprayStatistics:
    return spray_statistics(cone, ASKED)


def test_sampling_is_stated_and_what_is_not_corrected(told: SprayStatistics) -> None:
    assert told.sampling == "spatial"
    assert any("not corrected" in line for line in told.corrections)
    assert told.reasons == {}


def test_what_an_unsure_light_does_to_liquid_is_told(cone: list[StoredDroplets]) -> None:
    """Volumes go with the third power: of D32 = 60 um, 2 um more are 10 % of the liquid."""

    def seen(shot: StoredDroplets, light_sd_um: float) -> StoredDroplets:
        exposures = json.loads(str(shot.provenance["exposures"]))
        for one in exposures.values():
            one["views"] = {"view1": {"light_sd_um": light_sd_um}}
        return replace(shot, provenance={**shot.provenance, "exposures": json.dumps(exposures)})

    sure, unsure = (spray_statistics([seen(shot, sd_um) for shot in cone], ASKED) for sd_um in (0.0, 2.0))
    (line,) = set(unsure.corrections) - set(sure.corrections)
    assert f"{100 * 3 * 2 / value(sure.droplets.d32_um):.2g} % wrong" in line


def test_flux_and_density_are_what_the_droplets_carry(cone: list[StoredDroplets], told: SprayStatistics) -> None:
    """By hand: mean of 8 shots of 400 mm3 each."""
    assert told.motion
    d_mm = np.concatenate([shot.columns["diameter_um"] for shot in cone]).astype(float) / 1000
    down_mm_s = 1000 * np.concatenate([shot.columns["v_m_s"] for shot in cone]).astype(float)
    liquid_mm3 = np.pi / 6 * d_mm**3
    assert value(told.droplets.number_density_per_mm3) == pytest.approx(len(d_mm) / 3200)
    assert value(told.liquid_ppm) == pytest.approx(1e6 * liquid_mm3.sum() / 3200)
    assert value(told.motion.volume_flux_mm_s) == pytest.approx(liquid_mm3 @ down_mm_s / 3200)
    assert value(told.motion.mass_flux_kg_m2_s) == pytest.approx(liquid_mm3 @ down_mm_s / 3200)  # 1000 kg/m3, mm/s
    weights = down_mm_s * d_mm**2
    assert value(told.motion.flux_d32_um) == pytest.approx(1000 * weights @ d_mm / weights.sum())
    assert value(told.motion.flux_d32_um) > value(told.droplets.d32_um), "large ones fly faster"


def _shot(diameters_um: NDArray[np.float64], velocity_m_s: tuple[float, float, float], shot: int) -> StoredDroplets:
    """Droplets all around the axis that fly alike."""
    points_mm = cone_points_mm(np.random.default_rng(shot), len(diameters_um), 20.0, 4.0)
    return stored_shot(diameters_um, points_mm, np.tile(velocity_m_s, (len(diameters_um), 1)), shot)


def _sizes(count: int = 60) -> NDArray[np.float64]:
    return np.asarray(40 * np.exp(0.3 * np.random.default_rng(7).standard_normal(count)))


def _width(estimate: Estimate | None) -> float:
    """Over the value."""
    assert estimate
    return (estimate.high - estimate.low) / estimate.value


def test_shots_that_happen_to_be_alike_are_no_surer_than_their_droplets() -> None:
    sizes_um = _sizes()
    alike = [_shot(sizes_um[::step], (0.0, 10.0, 0.0), shot) for shot, step in enumerate((1, -1))]
    told = spray_statistics(alike, ASKED)
    together = spray_statistics([_shot(np.tile(sizes_um, 2), (0.0, 10.0, 0.0), 0)], ASKED)
    assert told.motion
    assert together.motion
    for few, counted in (
        (told.droplets.d32_um, together.droplets.d32_um),
        (told.liquid_ppm, together.liquid_ppm),
        (told.motion.volume_flux_mm_s, together.motion.volume_flux_mm_s),
        (told.motion.flux_d32_um, together.motion.flux_d32_um),
        (told.fits[0].scale_within_um, together.fits[0].scale_within_um),
    ):
        assert _width(few) == pytest.approx(_width(counted), rel=0.2)


def test_a_shot_without_droplets_makes_nothing_sure() -> None:
    empty = stored_shot(np.empty(0), np.empty((0, 3)), np.empty((0, 3)), 1)
    told = spray_statistics([*cone_shots(shots=1), empty], ASKED)
    assert told.motion
    assert _width(told.motion.speed_m_s) > 0
    assert _width(told.motion.by_size[4].speed_m_s) > 0
    for total in (told.liquid_ppm, told.motion.volume_flux_mm_s):
        assert total
        assert total.low == 0
        assert total.high > 2 * total.value


def test_droplets_that_do_not_differ_are_told() -> None:
    same = spray_statistics([_shot(np.full(60, 50.0), (0.0, 10.0, 0.0), shot) for shot in range(2)], ASKED)
    assert [doubt.split(":")[0] for doubt in same.doubts] == [
        "all 120 diameters are the very same",
        "all 120 velocities are the very same",
    ]
    assert same.motion
    assert same.motion.size_speed_correlation is None
    assert ALL_ALIKE in (same.motion.reason or "")


def test_droplets_that_stand_still_or_fly_back_have_no_flux_and_no_shares() -> None:
    still = spray_statistics([_shot(_sizes(), (0.0, 0.0, 0.0), shot) for shot in range(2)], ASKED)
    back = spray_statistics([_shot(_sizes(), (0.0, -10.0, 0.0), shot) for shot in range(2)], ASKED)
    for told in (still, back):
        assert told.motion
        assert told.motion.volume_flux_mm_s is None
        assert AGAINST in (told.motion.reason or "")
        (pattern,) = told.patternations
        assert (pattern.sector_shares, pattern.asymmetry) == ((), None)
        assert "nothing flows along the axis" in (pattern.reason or "")


def test_an_empty_ring_may_be_empty_by_chance(told: SprayStatistics) -> None:
    (pattern,) = told.patternations
    shares = [share for share in pattern.ring_shares if share and share.value == 0]
    assert shares
    for share in shares:
        assert 0 < share.high == pytest.approx(3.69 / pattern.n, rel=0.01)


def test_speeds_follow_the_sizes(told: SprayStatistics) -> None:
    assert told.motion
    assert value(told.motion.size_speed_correlation) == pytest.approx(1)
    assert told.motion.paired_share == 1
    for row in (row for row in told.motion.by_size if row.speed_m_s):
        assert 5 + row.low / 10 <= value(row.speed_m_s) <= 5 + row.high / 10
        assert value(row.radial_m_s) / value(row.axial_m_s) == pytest.approx(np.tan(np.radians(20)), rel=0.05)


def test_a_known_cone_has_its_angle(told: SprayStatistics) -> None:
    assert told.extent
    half, most = told.extent.cone_angle_half_deg, told.extent.cone_angle_deg
    assert value(half) == pytest.approx(40, abs=0.5)
    assert value(most) == pytest.approx(43.2, abs=0.4), "nine tenths of 18 to 22 degrees, twice"
    assert half
    assert half.low < 40 < half.high


def test_an_even_cone_is_no_more_uneven_than_chance_and_a_half_one_is(cone: list[StoredDroplets]) -> None:
    (even,) = spray_statistics(cone, ASKED).patternations
    assert even.asymmetry is not None
    assert even.asymmetry_by_chance is not None
    assert even.asymmetry < even.asymmetry_by_chance
    assert sum(value(share) for share in even.sector_shares) == pytest.approx(1)
    (half,) = spray_statistics([rows(shot, numbers(shot, "x_mm") > 0) for shot in cone], ASKED).patternations
    assert half.asymmetry == pytest.approx(0.5, abs=0.05)
    assert half.asymmetry_by_chance is not None
    assert half.asymmetry is not None
    assert half.asymmetry_by_chance < 0.4 < half.asymmetry


def test_shares_of_sectors_stay_between_none_and_all(cone: list[StoredDroplets]) -> None:
    sides = [rows(shot, sign * numbers(shot, "x_mm") > -1) for sign, shot in zip((1, -1), cone[:2], strict=True)]
    (told,) = spray_statistics(sides, ASKED).patternations
    shares = [share for share in (*told.sector_shares, *told.ring_shares) if share]
    assert any(share.low == 0 for share in shares)
    assert all(0 <= share.low <= share.value <= share.high <= 1 for share in shares)


def test_azimuths_say_which_way_a_sector_lies(cone: list[StoredDroplets]) -> None:
    towards = [rows(shot, -numbers(shot, "z_mm") > abs(numbers(shot, "x_mm"))) for shot in cone]
    (told,) = spray_statistics(towards, ASKED).patternations
    assert told.azimuths == ("x", "-z")
    assert sum(value(share) for share in told.sector_shares[1:3]) == pytest.approx(1), "45 to 135 degrees"


def rows(shot: StoredDroplets, which: NDArray[np.generic]) -> StoredDroplets:
    return StoredDroplets({name: column[which] for name, column in shot.columns.items()}, shot.provenance)


def numbers(shot: StoredDroplets, name: str) -> NDArray[np.float64]:
    return shot.columns[name].astype(np.float64)


def scaled(shot: StoredDroplets, scale: float) -> StoredDroplets:
    columns = {**shot.columns, "diameter_um": scale * numbers(shot, "diameter_um")}
    return StoredDroplets(columns, shot.provenance)


def renumbered(shots: Sequence[StoredDroplets]) -> list[StoredDroplets]:
    return [StoredDroplets(one.columns, {**one.provenance, "shot": number}) for number, one in enumerate(shots)]


def test_diameters_scale(cone: list[StoredDroplets], told: SprayStatistics) -> None:
    other = figures(spray_statistics([scaled(shot, 2.0) for shot in cone], ASKED))
    powers = {"ppm": 3, "flux": 3, "flux d32": 1} | {name: 1 for name in DIAMETERS if name != "relative_span"}
    for name, one in figures(told).items():
        assert other[name] == pytest.approx(one * 2.0 ** powers.get(name, 0), rel=1e-9), name


def test_the_order_of_droplets_and_shots_means_nothing(cone: list[StoredDroplets], told: SprayStatistics) -> None:
    rng = np.random.default_rng(1)
    mixed = [rows(cone[shot], rng.permutation(len(cone[shot].columns["frame"]))) for shot in rng.permutation(len(cone))]
    assert figures(spray_statistics(mixed, ASKED)) == pytest.approx(figures(told), rel=1e-9)


def test_all_shots_twice_change_no_figure(cone: list[StoredDroplets], told: SprayStatistics) -> None:
    twice = spray_statistics(renumbered([*cone, *cone]), ASKED)
    assert figures(twice) == pytest.approx(figures(told), rel=1e-9)
    assert twice.droplets.d32_um
    assert told.droplets.d32_um
    assert twice.droplets.d32_um.high < told.droplets.d32_um.high


def test_an_empty_shot_changes_densities_and_no_diameter(cone: list[StoredDroplets], told: SprayStatistics) -> None:
    """Nine shots of which one is empty have 8 / 9 of the droplets per volume."""
    empty = stored_shot(np.empty(0), np.empty((0, 3)), np.empty((0, 3)), shot=99)
    other = figures(spray_statistics([*cone, empty], ASKED))
    for name, one in figures(told).items():
        factor = 8 / 9 if name in ("density", "ppm", "flux") else 1
        assert other[name] == pytest.approx(factor * one, rel=1e-9), name


def test_a_spray_that_is_turned_with_its_axis_is_the_same(cone: list[StoredDroplets], told: SprayStatistics) -> None:
    """x, y, z become z, x, y: the box turns with it."""
    columns = {"x_mm": "z_mm", "y_mm": "x_mm", "z_mm": "y_mm", "u_m_s": "w_m_s", "v_m_s": "u_m_s", "w_m_s": "v_m_s"}
    box = VoxelGrid((40, 100, 100), (-4.95, -4.95, 8.05), 0.1)
    turned = []
    for number, shot in enumerate(cone):
        moved = {name: shot.columns[columns.get(name, name)] for name in shot.columns}
        points_mm = np.column_stack([moved[f"{axis}_mm"] for axis in "xyz"])
        velocities = np.column_stack([moved[name] for name in ("u_m_s", "v_m_s", "w_m_s")])
        turned.append(stored_shot(moved["diameter_um"], points_mm, velocities, number, box))  # type: ignore[arg-type]
    other = figures(spray_statistics(turned, replace(ASKED, axis=SprayAxis((0, 0, 0), (0, 0, 1)))))
    one = figures(told)
    assert {**other, "asymmetry": 0} == pytest.approx({**one, "asymmetry": 0}, rel=1e-9)


def test_what_cannot_be_known_is_null_with_a_reason_and_a_remedy(cone: list[StoredDroplets]) -> None:
    blind = spray_statistics(cone)
    assert (blind.extent, blind.patternations) == (None, ())
    assert blind.reasons["extent"] == blind.reasons["patternations"]
    assert blind.reasons["extent"].startswith(f"{NO_AXIS}; proposed by how droplets fly: --nozzle=0.00,0.00,0.00")
    assert blind.proposed_axis is not None
    assert blind.proposed_axis.axis == pytest.approx((0, 1, 0), abs=0.02)
    assert "--nozzle" in NO_AXIS
    assert blind.motion
    assert (blind.motion.volume_flux_mm_s, blind.motion.reason) == (None, NO_AXIS)
    beyond = spray_statistics(cone, AskedFor(DOWN, at_mm=(99.0,)))
    assert beyond.reasons["patternations"].startswith("99 mm from the nozzle: fewer than 20 droplets in the slice")
    assert "; the box reaches from " in beyond.reasons["patternations"]
    weightless = beyond.motion
    assert weightless
    assert (weightless.mass_flux_kg_m2_s, weightless.reason) == (None, NO_DENSITY)
    still = [rows(shot, np.arange(len(shot.columns["frame"]))) for shot in cone]
    for shot in still:
        for name in ("u_m_s", "v_m_s", "w_m_s"):
            del shot.columns[name]
    assert spray_statistics(still, ASKED).reasons["motion"] == NO_VELOCITIES
    assert spray_statistics([]).reasons["fits"]


def test_a_box_that_cuts_the_cone_tells_no_angle_and_a_spray_that_goes_on_no_penetration() -> None:
    wide = spray_statistics(cone_shots(half_angle_deg=35.0), ASKED).extent
    assert wide
    assert wide.cone_angle_deg is None
    assert "wider box" in (wide.cone_reason or "")
    assert wide.penetration_mm is None
    assert "longer box" in (wide.penetration_reason or "")


def test_a_spray_that_ends_in_the_box_has_a_penetration() -> None:
    shots = cone_shots()
    short = [rows(shot, numbers(shot, "y_mm") < 11) for shot in shots]
    extent = spray_statistics(short, ASKED).extent
    assert extent
    assert value(extent.penetration_mm) == pytest.approx(10.97, abs=0.04)


def in_clouds(ends_mm: float, clouds_mm: Sequence[tuple[float, float]]) -> SprayStatistics:
    """A spray of clouds from and to so many mm from the nozzle, in a box that ends at another distance."""
    rng, made = np.random.default_rng(3), []
    box = VoxelGrid((100, round(10 * (ends_mm - 2)), 100), (-4.95, 2.05, -4.95), 0.1)
    for shot in range(4):
        along_mm = np.concatenate([rng.uniform(*cloud, 150) for cloud in clouds_mm])
        points_mm = np.column_stack([rng.normal(0, 0.05, (len(along_mm), 2)) * along_mm[:, None], along_mm])[
            :, [0, 2, 1]
        ]
        seen = points_mm[along_mm < ends_mm]
        made.append(stored_shot(rng.uniform(30, 50, len(seen)), seen, shot=shot, grid=box))
    return spray_statistics(made, ASKED)


@pytest.mark.parametrize(("ends_mm", "penetration_mm"), [(9.0, 7.9), (20.0, None), (24.0, 17.5)])
def test_a_spray_in_clouds_may_go_on_behind_a_gap(ends_mm: float, penetration_mm: float | None) -> None:
    """Clouds end at 8 and 17.6 mm. A box that ends in the first gap says so; one that has seen it asks for more."""
    told = in_clouds(ends_mm, [(2, 8), (12, 17.6)])
    extent = told.extent
    assert extent
    if penetration_mm is None:
        assert extent.penetration_mm is None
        assert "has a gap of 4" in (extent.penetration_reason or "")
        assert told.not_checked == ()
    else:
        assert value(extent.penetration_mm) == pytest.approx(penetration_mm, abs=0.1)
        (unchecked,) = told.not_checked
        assert f"behind a gap of {ends_mm - penetration_mm:.1g}" in unchecked.what


@pytest.mark.parametrize(("half_deg", "lean_deg"), [(4.0, 30.0), (22.0, 0.0)])
def test_a_spray_that_leaves_the_box_by_its_sides_has_no_penetration(half_deg: float, lean_deg: float) -> None:
    """A narrow one that leans, and a wide one: neither reaches the far end of the box, and both go on."""
    rng, box, gone = np.random.default_rng(0), VoxelGrid((100, 120, 100), (-4.95, 8.05, -4.95), 0.1), []
    lean = float(np.tan(np.radians(lean_deg)))
    for shot in range(4):
        along_mm, azimuth = rng.uniform(8, 20, 300), rng.uniform(0, 2 * np.pi, 300)
        from_mm = along_mm * np.tan(np.radians(half_deg))
        points_mm = np.column_stack([from_mm * np.cos(azimuth) + lean * along_mm, along_mm, from_mm * np.sin(azimuth)])
        seen = points_mm[(np.abs(points_mm[:, [0, 2]]) < 5).all(axis=1)]
        gone.append(stored_shot(rng.uniform(30, 50, len(seen)), seen, shot=shot, grid=box))
    extent = spray_statistics(gone, AskedFor(SprayAxis((0, 0, 0), (lean, 1, 0)))).extent
    assert extent
    assert extent.penetration_mm is None
    assert "leaves the box by its sides" in (extent.penetration_reason or "")


def fan(half_angle_deg: float) -> list[StoredDroplets]:
    """Shots of a flat fan in the plane of x and y, of which the box holds what is within 4.95 mm of the axis."""
    rng, made = np.random.default_rng(4), []
    for shot in range(6):
        along_mm = rng.uniform(8, 12, 400)
        degrees = np.column_stack([rng.uniform(-half_angle_deg, half_angle_deg, 400), rng.normal(0, 2, 400)])
        x_mm, z_mm = along_mm * np.tan(np.radians(degrees.T))
        points_mm = np.column_stack([x_mm, along_mm, z_mm])
        made.append(in_box(stored_shot(rng.uniform(30, 50, 400), points_mm, shot=shot)))
    return made


@pytest.mark.parametrize(("half_angle_deg", "told"), [(20, True), (30, False), (40, False)])
def test_a_fan_that_the_box_cuts_at_both_sides_has_no_angle(half_angle_deg: float, told: bool) -> None:
    extent = spray_statistics(fan(half_angle_deg), ASKED).extent
    assert extent
    assert (extent.cone_angle_deg is not None) == told
    assert told or (extent.cone_angle_half_deg is None and "does not reach around" in (extent.cone_reason or ""))


def test_a_core_that_ends_in_the_box_tells_no_penetration_of_a_cone_that_leaves_it_before() -> None:
    """Most of the liquid flies 60 degrees from the axis, farther than the box tells; a thin core ends at 9 mm."""
    rng, box, shots = np.random.default_rng(0), VoxelGrid((100, 120, 100), (-4.95, 2.05, -4.95), 0.1), []
    for shot in range(4):
        way_mm = np.concatenate([rng.uniform(2, 30, 1500), rng.uniform(2, 9, 100)])
        angle = np.radians(np.where(np.arange(1600) < 1500, 60.0, 6.0) + rng.normal(0, 2, 1600))
        azimuth = rng.uniform(0, 2 * np.pi, 1600)
        ways = np.column_stack([np.sin(angle) * np.cos(azimuth), np.cos(angle), np.sin(angle) * np.sin(azimuth)])
        points_mm = way_mm[:, None] * ways
        seen = points_mm[(np.abs(points_mm - [0, 8, 0]) < [5, 6, 5]).all(axis=1)]
        shots.append(stored_shot(rng.uniform(30, 50, len(seen)), seen, shot=shot, grid=box))
    extent = spray_statistics(shots, ASKED).extent
    assert extent
    assert "leaves the box by its sides" in (extent.penetration_reason or "")


def test_droplets_without_partner_take_the_mean_velocity_of_the_others(cone: list[StoredDroplets]) -> None:
    """Lost at random, a third of the velocities changes the flux by chance only."""
    rng = np.random.default_rng(2)
    full, lost = spray_statistics(cone, ASKED).motion, []
    for shot in cone:
        gone = rng.random(len(shot.columns["frame"])) < 1 / 3
        unpaired = {name: np.where(gone, np.nan, shot.columns[name]) for name in ("u_m_s", "v_m_s", "w_m_s")}
        lost.append(StoredDroplets({**shot.columns, **unpaired}, shot.provenance))
    partly = spray_statistics(lost, ASKED).motion
    assert full
    assert partly
    assert partly.paired_share == pytest.approx(2 / 3, abs=0.03)
    assert value(partly.volume_flux_mm_s) == pytest.approx(value(full.volume_flux_mm_s), rel=0.02)


def test_one_shot_draws_its_droplets_and_says_that_its_sample_is_low(cone: list[StoredDroplets]) -> None:
    one = spray_statistics(cone[:1], ASKED)
    assert one.droplets.intervals_over == "droplets"
    assert one.sample
    assert one.sample.verdict == "low sample"
    assert "how shots differ" in one.sample.reasons[0]
    assert one.motion
    assert one.motion.volume_flux_mm_s


def test_two_exposures_of_one_shot_make_nothing_surer() -> None:
    (shot,) = cone_shots(0, 1, 1000)
    columns = {name: np.concatenate([column, column]) for name, column in shot.columns.items()}
    columns["frame"] = np.repeat(["a", "b"], len(shot.columns["frame"]))
    exposure = json.loads(str(shot.provenance["exposures"]))["a"]
    both = {**shot.provenance, "exposures": json.dumps({"a": exposure, "b": exposure})}
    once, twice = (spray_statistics([one], ASKED) for one in (shot, StoredDroplets(columns, both)))
    assert figures(twice) == pytest.approx(figures(once), rel=1e-9)
    for told in ("extent.cone_angle_deg", "motion.volume_flux_mm_s", "liquid_ppm"):
        widths = [width(operator.attrgetter(told)(one)) for one in (once, twice)]
        assert widths[1] == pytest.approx(widths[0], rel=0.25), told
    assert twice.fits[0].gap_by_chance == pytest.approx(once.fits[0].gap_by_chance, rel=0.25)
    by_chance = [one.patternations[0].asymmetry_by_chance for one in (once, twice)]
    assert by_chance[1] == pytest.approx(by_chance[0], rel=0.25)


def width(estimate: Estimate) -> float:
    return float(np.log(estimate.high / estimate.low))


def test_droplets_without_places_and_volume_have_sizes_and_say_what_is_missing() -> None:
    """As of a single view, whose files have x_um and no grid."""
    flat = []
    for shot in cone_shots(0, 3, 60):
        columns = {name: shot.columns[name] for name in ("frame", "diameter_um")}
        flat.append(StoredDroplets(columns, {**shot.provenance, "grid": "null"}))
    told = spray_statistics(flat, ASKED)
    assert told.droplets.d32_um
    assert (told.liquid_ppm, told.patternations, told.motion) == (None, (), None)
    assert set(told.reasons) == {"motion", "patternations", "liquid_ppm"}
    assert told.extent
    assert told.extent.cone_reason
    assert "NaN" not in told.model_dump_json()


def test_nothing_is_not_a_number_in_json(told: SprayStatistics) -> None:
    assert "NaN" not in told.model_dump_json()
    assert SprayStatistics.model_validate_json(told.model_dump_json()) == told
    assert BOX.volume_mm3 == pytest.approx(400)
