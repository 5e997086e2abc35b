"""The hunt for lies finds those that are planted, calls nothing a lie that is right, and draws the same case again."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.hunt.__main__ import line, table
from tests.hunt.__main__ import main as hunt
from tests.hunt.answer import Answer, Told, asked
from tests.hunt.case import Case, case_of, drawn_case
from tests.hunt.distortions import DISTORTIONS
from tests.hunt.judge import SIZES, in_box, judged, mean_um
from tests.hunt.light import Bodies, behind_blur, by_waves, covered
from tests.hunt.rig import believed, eyes
from tests.hunt.world import HALF_MM, KINDS, SEPARATION_NS, Pictures, World, drawn, taken

NOTHING = np.zeros((0, 2))
WORLD = drawn("some", 1)


def test_views_see_points_where_the_cameras_of_the_product_do() -> None:
    points_mm = np.random.default_rng(1).uniform(-1, 1, (20, 3))
    for eye, view in zip(eyes(4), believed(eyes(4), HALF_MM).views.values(), strict=True):
        np.testing.assert_allclose(eye.sees(points_mm)[0], view.mapping.project(points_mm), atol=1e-9)


def test_a_blurred_disc_takes_as_much_light_as_it_is_wide() -> None:
    image = behind_blur(covered(Bodies(np.array([[30.3, 20.6]]), np.array([4.0]), np.zeros((1, 2))), (60, 40)), 0.8)
    missing = 1 - image
    np.testing.assert_allclose(missing.sum(), np.pi * 16, rtol=2e-3)
    row, column = np.mgrid[:40, :60]
    np.testing.assert_allclose([np.sum(missing * at) / missing.sum() for at in (column, row)], (30.3, 20.6), atol=0.01)


@pytest.mark.parametrize("ratio", [0.5, 1.6, 8.0])
def test_waves_pass_undisturbed_where_nothing_is_and_find_a_disc_where_it_is(ratio: float) -> None:
    empty = covered(Bodies(NOTHING, np.zeros(0), NOTHING), (60, 40))
    np.testing.assert_allclose(by_waves(empty, ratio, 3.8), 1, atol=1e-9)
    disc = covered(Bodies(np.array([[30.25, 20.5]]), np.array([4.0]), np.zeros((1, 2))), (60, 40))
    missing = (1 - by_waves(disc, ratio, 3.8))[10:31, 20:41]
    row, column = np.mgrid[10:31, 20:41]
    np.testing.assert_allclose([np.sum(missing * at) / missing.sum() for at in (column, row)], (30.25, 20.5), atol=0.1)
    assert missing[10, 10] > 0.9


def test_light_from_few_directions_makes_fringes_and_from_all_none() -> None:
    disc = covered(Bodies(np.array([[30.0, 20.0]]), np.array([4.0]), np.zeros((1, 2))), (60, 40))
    assert by_waves(disc, 0.5, 3.8).max() > 1.02
    assert by_waves(disc, 8.0, 3.8).max() < 1.001


def test_the_same_seed_is_the_same_world() -> None:
    one, other = taken(drawn("single", 4)), taken(drawn("single", 4))
    np.testing.assert_array_equal(one.shots, other.shots)
    assert np.any(one.shots != taken(drawn("single", 5)).shots)


@pytest.mark.parametrize("kind", KINDS)
def test_droplets_of_a_world_lie_in_its_box(kind: str) -> None:
    for cloud in drawn(kind, 2).clouds:
        assert len(in_box(cloud.round).diameters_um) == len(cloud.round.diameters_um) >= KINDS[kind].least


@pytest.fixture(scope="module")
def pictures() -> Pictures:
    return taken(WORLD)


@pytest.mark.parametrize("name", DISTORTIONS)
def test_a_distortion_changes_something_and_leaves_what_it_was_given(name: str, pictures: Pictures) -> None:
    distortion, rng = DISTORTIONS[name], np.random.default_rng(3)
    if distortion.world:
        world, told = distortion.world(WORLD, 0.5, rng)
        assert world is not WORLD
    if distortion.pictures:
        before = pictures.shots.copy()
        changed, told = distortion.pictures(pictures, 0.6, rng)
        np.testing.assert_array_equal(pictures.shots, before)
        assert _differ(changed, pictures)
    assert told


def _differ(one: Pictures, other: Pictures) -> bool:
    names = ("shots", "backgrounds", "darks")
    return one.missing != other.missing or any(np.any(getattr(one, name) != getattr(other, name)) for name in names)


def truthful(world: World, **changes: Any) -> Answer:
    """An answer that knows the truth, to half a percent."""
    told = {}
    for shot, cloud in enumerate(world.clouds):
        for exposure, seen in enumerate((in_box(cloud.round), in_box(cloud.round.moved))):
            count = len(seen.diameters_um)
            told[shot, exposure] = Told(seen.places_mm, seen.diameters_um, np.full(count, 0.3), np.zeros((count, 3)))
    diameters_um = np.concatenate([one.diameters_um for one in told.values()])
    density = len(diameters_um) / 2 / float(np.prod(2 * HALF_MM))
    velocity = 1e6 * np.mean([cloud.ways_mm.mean(axis=0) for cloud in world.clouds], axis=0) / SEPARATION_NS
    said = {
        "shots": [{"verdict": "good", "reasons": [], "velocity": {"verdict": "good", "reasons": []}}],
        "statistics": {
            "number_density_per_mm3": around(density, 0.2),
            "light_sd_um": 0.0,
            **{name: around(mean_um(name, diameters_um), 0.1) for name in SIZES},
        },
        "velocity": {"mean_m_s": {name: around(float(one), 0.01) for name, one in zip("uvw", velocity, strict=True)}},
        "not_checked": [],
    }
    return Answer("", {**said, **changes}, {}, told, "")


def around(value: float, share: float) -> dict[str, float]:
    return {"value": value, "low": value - share * abs(value), "high": value + share * abs(value)}


def test_the_truth_is_right() -> None:
    assert judged(WORLD, truthful(WORLD), []).outcome == "right"


def larger(answer: Answer) -> Answer:
    told = {place: replace(one, diameters_um=1.05 * one.diameters_um) for place, one in answer.told.items()}
    return replace(answer, told=told)


def fewer(answer: Answer) -> Answer:
    told = answer.told[0, 0]
    return replace(
        answer,
        told={
            **answer.told,
            (0, 0): Told(told.places_mm[:-9], told.diameters_um[:-9], told.deviations_um[:-9], NOTHING),
        },
    )


def elsewhere(answer: Answer) -> Answer:
    told = {place: replace(one, places_mm=one.places_mm[:, ::-1]) for place, one in answer.told.items()}
    return replace(answer, told=told)


def faster(answer: Answer) -> Answer:
    means = {name: around(1.1 * one["value"], 0.01) for name, one in answer.said["velocity"]["mean_m_s"].items()}
    return replace(answer, said={**answer.said, "velocity": {"mean_m_s": means}})


def denser(answer: Answer) -> Answer:
    density = answer.said["statistics"]["number_density_per_mm3"]["value"]
    statistics = {**answer.said["statistics"], "number_density_per_mm3": around(1.4 * density, 0.1)}
    return replace(answer, said={**answer.said, "statistics": statistics})


PLANTED = {"diameters": larger, "count a": fewer, "places a": elsewhere, "v": faster, "number_density_per_mm3": denser}


@pytest.mark.parametrize("number", PLANTED)
def test_a_planted_lie_is_found_and_neither_a_doubt_nor_a_name_leaves_one(number: str) -> None:
    answer = PLANTED[number](truthful(WORLD))
    found = judged(WORLD, answer, ["no such words"])
    assert found.outcome == "lie"
    assert number in {one.number for one in found.wrong}

    named = replace(answer, said={**answer.said, "not_checked": [{"what": "whether all is well", "state": ""}]})
    assert judged(WORLD, named, ["all is well"]).outcome == "named"
    assert judged(WORLD, named, ["", "something else"]).outcome == "lie"

    doubtful = {"verdict": "doubtful", "reasons": ["it looks odd"], "velocity": {"verdict": "good", "reasons": []}}
    doubted = judged(WORLD, replace(answer, said={**answer.said, "shots": [doubtful], "velocity": None}), [])
    assert (doubted.outcome, doubted.doubts) == ("doubted", ("doubtful: it looks odd",))


def test_a_doubt_of_velocities_leaves_wrong_diameters_a_lie() -> None:
    answer = larger(truthful(WORLD))
    doubtful = {"verdict": "doubtful", "reasons": ["too few pairs"]}
    shots = [{"verdict": "good", "reasons": [], "velocity": doubtful}]
    assert judged(WORLD, replace(answer, said={**answer.said, "shots": shots}), []).outcome == "lie"


def test_a_doubt_of_velocities_excuses_an_exposure_b_that_is_another() -> None:
    answer = truthful(WORLD)
    shots = [{"verdict": "good", "reasons": (), "velocity": None, "velocity_reason": "one image is there twice"}]
    another = replace(answer, told={**answer.told, (0, 1): elsewhere(answer).told[0, 1]})
    assert judged(WORLD, another, []).outcome == "lie"
    assert judged(WORLD, replace(another, said={**answer.said, "shots": shots}), []).outcome == "doubted"


def test_an_undistorted_world_is_measured_right() -> None:
    case = case_of(replace(drawn("single", 3), stated_light="gaussian"), {}, np.random.default_rng(3))
    assert (case.outcome, case.distortions) == ("right", ())
    assert line(case).startswith("right")


def test_a_hunt_that_is_ended_tells_what_it_has_found(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def ended(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("processing.runs.droplets.measurement.RunMeasurement.of", ended)
    assert hunt(["--cases", "2", "--world", "single", "--distortions", "none"]) == 0
    assert "0 cases: 0 lies" in capsys.readouterr().out


def test_a_wrong_separation_is_wrong_and_named_and_would_else_be_a_lie(tmp_path: Path) -> None:
    """The whole way: the run, both commands, their JSON, and the judge."""
    world = replace(WORLD, stated_ns=2 * SEPARATION_NS, stated_light="gaussian")
    answer = asked(tmp_path, world, taken(world))
    assert judged(world, answer, [DISTORTIONS["separation wrong"].named]).outcome == "named"
    lie = judged(world, answer, [])
    assert lie.outcome == "lie"
    np.testing.assert_allclose(next(one for one in lie.wrong if one.number == "v").error, -0.5, atol=0.05)


def test_the_table_counts_alarms_of_undistorted_worlds_and_lies_of_the_others() -> None:
    doubted = judged(WORLD, Answer("nothing there", {}, {}, {}, ""), [])
    lie = judged(WORLD, fewer(truthful(WORLD)), [])
    cases = [Case(1, "some", (), doubted), Case(2, "some", (("gamma", "2"),), lie)]
    assert [case.outcome for case in cases] == ["alarm", "lie"]
    lines = table(cases)
    assert lines[1].split() == ["gamma", "1"]
    assert lines[-1] == "2 cases: 1 lies, 0 named in not_checked, 0 right; 1 alarms in 1 undistorted worlds"


def test_the_same_seed_is_the_same_case(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "tests.hunt.case.asked",
        lambda _folder, world, seen: Answer(f"{world.noise} {seen.shots.sum()}", {}, {}, {}, ""),
    )
    one, other = (drawn_case(7, "single") for _ in range(2))
    assert one == other != drawn_case(8, "single")


def test_what_says_nothing_is_no_distortion(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a single exposure there is no B to exchange with."""
    monkeypatch.setattr("tests.hunt.case.asked", lambda *_: Answer("not asked", {}, {}, {}, ""))
    assert case_of(drawn("single", 1), {"exchanged": 0.5}, np.random.default_rng(1)).distortions == ()
