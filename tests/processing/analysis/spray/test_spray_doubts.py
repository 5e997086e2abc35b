"""What makes the figures of a spray doubtful is told with them, not only shot by shot."""

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from processing.analysis.copied_shots import in_common
from processing.analysis.droplets.droplet_file import StoredDroplets
from processing.analysis.droplets.droplet_statistics import ALL_HIDDEN
from processing.analysis.spray.spray_axis import SprayAxis
from processing.analysis.spray.spray_statistics import AskedFor, spray_statistics
from tests.support.sampled_sprays import cone_shots

DOWN = SprayAxis((0, 0, 0), (0, 1, 0))
SHOTS = cone_shots(0, 4, 60)


def saying(shot: StoredDroplets, **told: str) -> StoredDroplets:
    return replace(shot, provenance={**shot.provenance, **told})


def exposure(verdict: str) -> str:
    return json.dumps({"a": {"verdict": verdict, "reasons": ["it is blurred"]}})


def doubts(*shots: StoredDroplets, axis: SprayAxis = DOWN) -> str:
    return "\n".join(spray_statistics(shots, AskedFor(axis)).doubts)


def moved(shot: StoredDroplets, factor: float) -> StoredDroplets:
    velocities: dict[str, Any] = {
        name: shot.columns[name].astype(float) * factor for name in ("u_m_s", "v_m_s", "w_m_s")
    }
    return replace(shot, columns={**shot.columns, **velocities})


def test_nothing_is_doubted_of_good_shots() -> None:
    assert not doubts(*SHOTS)


def test_doubtful_and_refused_exposures_are_told_with_their_reasons() -> None:
    told = doubts(saying(SHOTS[0], exposures=exposure("doubtful")), *SHOTS[1:])
    assert told == "1 of 4 exposures are doubtful, and count: it is blurred"
    nobody = replace(SHOTS[0], columns={name: one[:0] for name, one in SHOTS[0].columns.items()})
    told = doubts(saying(nobody, exposures=exposure("refused")), *SHOTS[1:])
    assert told == "1 of 4 exposures are refused, and do not count: it is blurred"
    alone = spray_statistics([saying(nobody, exposures=exposure("refused"))])
    assert alone.doubts == ("1 of 1 exposure are refused, and do not count: it is blurred",)


def test_doubtful_velocities_are_told() -> None:
    said = json.dumps({"verdict": "doubtful", "reasons": ["half of the droplets have no partner"]})
    told = doubts(saying(SHOTS[0], velocity=said), *SHOTS[1:])
    assert told == "velocities of 1 of 4 shots are doubtful, and count: half of the droplets have no partner"
    assert not doubts(*(saying(shot, velocity='{"reason": "shots have one exposure"}') for shot in SHOTS))


@pytest.mark.parametrize("exchanged", [1, 2, 3])
def test_shots_whose_exposures_are_exchanged_are_told_although_their_mean_is_next_to_nothing(exchanged: int) -> None:
    told = doubts(*(moved(shot, -1) for shot in SHOTS[:exchanged]), *SHOTS[exchanged:])
    assert f"droplets of {min(exchanged, 4 - exchanged)} of 4 shots fly against those of the others" in told
    assert "exposures A and B exchanged" in told


@pytest.mark.parametrize("direction", [(0, -1, 0), (0, 0, 1), (1, 0.5, 0)])
def test_an_axis_along_which_the_droplets_do_not_fly_is_told(direction: tuple[float, float, float]) -> None:
    told = doubts(*SHOTS, axis=SprayAxis((0, 0, 0), direction))
    assert "from the axis" in told
    assert "is it stated rightly" in told


@pytest.mark.parametrize("factor", [0.1, 10.0])
def test_shots_of_another_separation_or_spray_are_told(factor: float) -> None:
    """One run whose separation was stated in another unit makes a mean speed that neither has."""
    told = doubts(moved(SHOTS[0], factor), *SHOTS[1:])
    assert "droplets of 1 of 4 shots fly 2.5 times faster or slower than those of the others" in told
    assert "is the separation right" in told
    assert not doubts(moved(SHOTS[0], 1.5), *SHOTS[1:])


def test_a_nozzle_in_another_unit_is_told() -> None:
    told = doubts(*SHOTS, axis=SprayAxis((0, -12000, 0), (0, 1, 0)))
    assert "is its place in mm?" in told


def test_droplets_behind_the_nozzle_are_told() -> None:
    told = doubts(*SHOTS, axis=SprayAxis((0, 9, 0), (0, 1, 0)))
    assert "% of the droplets lie behind the nozzle: is it stated rightly" in told


def without_velocities(shot: StoredDroplets) -> StoredDroplets:
    columns = {name: values for name, values in shot.columns.items() if not name.endswith("_m_s")}
    return replace(shot, columns=columns)


@pytest.mark.parametrize("nozzle_mm", [(6, 0, 0), (0, 0, -5), (-4, 1, 4)])
def test_a_nozzle_beside_the_spray_is_told_by_the_flight_of_the_droplets(nozzle_mm: tuple[float, float, float]) -> None:
    told = doubts(*SHOTS, axis=SprayAxis(nozzle_mm, (0, 1, 0)))
    assert "degrees aside of the way from the nozzle, in the mean: is its place stated rightly" in told


def test_a_nozzle_beside_the_spray_is_told_by_the_places_of_the_droplets() -> None:
    still = [without_velocities(shot) for shot in SHOTS]
    assert "beside the droplets, farther than the box is wide" in doubts(*still, axis=SprayAxis((30, 0, 0), (0, 1, 0)))
    narrow = [without_velocities(shot) for shot in cone_shots(0, 4, 60, 4.0)]
    assert "lie on one side of the axis" in doubts(*narrow, axis=SprayAxis((4.5, 0, 0), (0, 1, 0)))
    assert "seen from the stated nozzle" in doubts(*narrow, axis=SprayAxis((0.5, 0, 0), (0, 1, 0)))
    assert not doubts(*narrow, axis=SprayAxis((0.1, 0, 0), (0, 1, 0)))
    assert not doubts(*narrow)


def test_a_part_of_a_cone_contradicts_no_nozzle() -> None:
    """A box that shows a quarter of it, and the axis at its edge."""
    whole = json.loads(str(SHOTS[0].provenance["grid"]))
    nz, ny, nx = whole["shape"]
    grid = json.dumps({**whole, "shape": [nz // 2, ny, nx // 2], "origin_mm": [0.05, whole["origin_mm"][1], 0.05]})
    quarter = []
    for shot in (saying(one, grid=grid) for one in SHOTS):
        x_mm, z_mm = (np.asarray(shot.columns[name], float) for name in ("x_mm", "z_mm"))
        rows = (x_mm > 0) & (z_mm > 0)
        quarter.append(replace(shot, columns={name: values[rows] for name, values in shot.columns.items()}))
    assert not doubts(*quarter)
    assert not doubts(*map(without_velocities, quarter))


def test_exposures_that_are_exchanged_are_told() -> None:
    assert "are exposures A and B exchanged" in doubts(*(moved(shot, -1.0) for shot in SHOTS))


def test_droplets_faster_than_any_spray_are_told() -> None:
    assert "is the separation stated rightly" in doubts(*(moved(shot, 1000.0) for shot in SHOTS))
    assert not doubts(*(moved(shot, 50.0) for shot in SHOTS))


def test_droplets_that_fly_in_all_directions_contradict_no_axis() -> None:
    rng = np.random.default_rng(0)
    names = ("u_m_s", "v_m_s", "w_m_s")
    any_way = [dict(zip(names, rng.standard_normal((3, len(shot.columns["frame"]))), strict=True)) for shot in SHOTS]
    scattered = [replace(shot, columns={**shot.columns, **its}) for shot, its in zip(SHOTS, any_way, strict=True)]
    assert not doubts(*scattered)


def test_a_shot_that_is_a_copy_of_another_one_is_told_whatever_it_is_called() -> None:
    copied = replace(SHOTS[1], provenance={**SHOTS[1].provenance, "run": "renamed", "shot": 9})
    assert doubts(*SHOTS, copied) == "renamed, shot 9 has the very droplets of spray, shot 1: one is a copy"


def test_a_shot_that_was_imported_twice_and_measured_in_two_ways_is_told_by_its_images() -> None:
    once = [saying(shot, images=f"{number:032x}") for number, shot in enumerate(SHOTS)]
    columns = {name: one[5:] for name, one in once[1].columns.items()}
    again = replace(saying(once[1], run="imported again"), columns=columns)
    assert doubts(*once, again) == "imported again, shot 1 has the very images of spray, shot 1: one is a copy"
    assert in_common([again], once) == 1
    assert in_common([saying(again, images="another")], once) == 0
    assert not doubts(*(saying(shot, images="") for shot in SHOTS))


def test_an_exposure_that_is_hidden_as_a_whole_leaves_the_others_what_they_are() -> None:
    hidden = json.dumps({"a": {"verdict": "doubtful", "hidden": {"volume_share": 1.0}}})
    nobody = replace(SHOTS[0], columns={name: one[:0] for name, one in SHOTS[0].columns.items()})
    told, without = spray_statistics([saying(nobody, exposures=hidden), *SHOTS[1:]]), spray_statistics(SHOTS[1:])
    assert told.liquid_ppm
    assert without.liquid_ppm
    assert told.liquid_ppm.value == without.liquid_ppm.value


def test_shots_that_are_all_hidden_have_no_density_and_say_why() -> None:
    hidden = json.dumps({"a": {"verdict": "doubtful", "hidden": {"volume_share": 1.0}}})
    nobody = [replace(shot, columns={name: one[:0] for name, one in shot.columns.items()}) for shot in SHOTS]
    told = spray_statistics([saying(shot, exposures=hidden) for shot in nobody]).droplets
    assert told.number_density_per_mm3 is None
    assert told.number_density_reason == ALL_HIDDEN


def test_shots_of_different_conditions_are_told() -> None:
    notes = json.dumps({"fluid": "water", "operator": "Ada", "pressure_bar": 6.0, "more": {"flow_l_min": 1.2}})
    others = json.dumps({"fluid": "water", "operator": "Bo", "pressure_bar": 20.0})
    told = doubts(saying(SHOTS[0], notes=notes), *(saying(shot, notes=others) for shot in SHOTS[1:]))
    assert told.splitlines() == [
        "shots differ in pressure_bar: 6.0 and 20.0; they are no one spray",
        "shots differ in flow_l_min: 1.2 and not stated; they are no one spray",
    ]
    assert not doubts(*(saying(shot, notes=notes) for shot in SHOTS))


def test_droplets_faster_than_the_pressure_makes_them_are_told() -> None:
    """A separation that was stated half as long makes 9 m/s 18; 0.5 bar make no more than 12.9."""
    noted = [saying(shot, notes=json.dumps({"pressure_bar": 0.5})) for shot in SHOTS]
    told = doubts(*(moved(shot, 2.0) for shot in noted))
    assert "m/s, but 0.5 bar make no liquid faster than 12.9 m/s" in told
    assert "is the separation stated rightly" in told
    assert not doubts(*noted)
    assert "bar make" not in doubts(*(moved(shot, 2.0) for shot in noted[:3]), moved(SHOTS[3], 2.0))


def test_shots_of_two_boxes_are_told() -> None:
    grid = json.loads(str(SHOTS[0].provenance["grid"]))
    other = saying(SHOTS[0], grid=json.dumps({**grid, "shape": [100, 40, 120]}))
    told = doubts(other, *SHOTS[1:])
    assert "shots were measured in 2 boxes (x -5 to 7, y 8 to 12, z -5 to 5 mm; x -5 to 5, y 8" in told
    assert "densities, flux and sizes are means over both places" in told


def losing(shot: StoredDroplets, which: NDArray[np.bool_]) -> StoredDroplets:
    """Without the velocities of some droplets."""
    lost = {name: np.where(which, np.nan, shot.columns[name]) for name in ("u_m_s", "v_m_s", "w_m_s")}
    return replace(shot, columns={**shot.columns, **lost})


def test_velocities_that_large_droplets_lack_are_told_with_what_they_would_make() -> None:
    """Large ones fly faster: without two thirds of them the mean speed is 3 % too small."""
    rng, shots = np.random.default_rng(3), cone_shots(1, 6, 300)
    d_um = [np.asarray(one.columns["diameter_um"], float) for one in shots]
    large = [rng.random(len(one)) < 2 / 3 * (one > 50) for one in d_um]
    told = doubts(*map(losing, shots, large))
    true = np.mean(5 + np.concatenate(d_um) / 10)
    assert "have no velocity, and are of other sizes" in told
    assert float(told.split(" but ")[1].split()[0]) == pytest.approx(true, rel=0.01)
    by_chance = [rng.random(len(one)) < 0.4 for one in d_um]
    assert not doubts(*map(losing, shots, by_chance))


def test_a_flux_that_lacks_the_velocities_of_the_largest_droplets_is_told() -> None:
    """They are 4 % of the droplets, a third of the liquid: the mean speed hardly knows it, the flux is 16 % small."""
    shots = cone_shots(1, 12, 300)
    d_um = [np.asarray(one.columns["diameter_um"], float) for one in shots]
    told = doubts(*(losing(one, its > 80) for one, its in zip(shots, d_um, strict=True)))
    assert "no velocity, and are of other sizes than those that have one: flux is wrong by a factor of 1.0" in told
    cubes, speeds = np.concatenate(d_um) ** 3, 5 + np.concatenate(d_um) / 10
    paired = np.concatenate(d_um) <= 80
    assert np.average(speeds[paired], weights=cubes[paired]) < 0.86 * np.average(speeds, weights=cubes)
    rng = np.random.default_rng(4)
    assert not doubts(*(losing(one, rng.random(len(its)) < 0.05) for one, its in zip(shots, d_um, strict=True)))


def test_velocities_that_none_of_the_largest_droplets_has_are_told_too() -> None:
    """They are counted as fast as the next smaller ones."""
    shots = cone_shots(1, 6, 300)
    told = doubts(*(losing(one, np.asarray(one.columns["diameter_um"], float) > 45) for one in shots))
    assert "have no velocity, and are of other sizes" in told
    assert not doubts(*shots)
