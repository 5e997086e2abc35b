"""Light that shows is found, and diameters are corrected for it; behind a Gaussian blur it is left alone."""

from dataclasses import replace

import numpy as np
import pytest

from processing.analysis.droplets.droplet_search import plan_droplets
from processing.analysis.droplets.ghost_share import matches
from processing.analysis.droplets.measured_exposure import ShotVerdict
from processing.analysis.droplets.shadows.discs.disc_optics import first_disc_optics
from processing.analysis.droplets.shadows.discs.opaque_discs import Discs
from processing.analysis.droplets.shadows.light.fringes import Fringes
from processing.analysis.droplets.shadows.light.light_search import NamedLight, Relit, seen_light
from processing.analysis.droplets.shadows.light.seen_light import SeenLight
from processing.analysis.droplets.shadows.relit_discs import relit
from processing.analysis.droplets.shadows.shadow_fit import ShadowFit
from processing.analysis.droplets.shadows.shadow_shot import measure_shadows
from processing.geometry import FloatArray
from processing.studies.shadows.sizes import SizeCase, size_scene
from processing.studies.simulated_droplets import study_grid
from tests.support.shadow_scenes import search_of, shadow_scene

SHAPE, IMAGE_SIZE_PX, RATIO = (120, 30, 200), (280, 80), 0.8


def test_partially_coherent_light_is_found_and_diameters_are_corrected_for_it() -> None:
    grid = study_grid(SHAPE)
    scene = size_scene(SizeCase(10, condenser_ratio=RATIO), grid, IMAGE_SIZE_PX, np.random.default_rng(5))
    shot = measure_shadows(scene.images, plan_droplets(scene.believed, grid, margin_voxel=8))
    assert shot.verdict is ShotVerdict.GOOD
    assert [view.condenser_ratio for view in shot.views.values()] == pytest.approx([RATIO] * 4, abs=0.05)
    match, _ = matches(shot.droplets.points_mm, scene.spray.positions_mm, grid.pitch_mm)
    real = match >= 0
    assert np.mean(real) > 0.95
    true_um = 1000 * scene.spray.diameters_mm[match[real]]
    assert abs(np.median(shot.droplets.diameters_um[real] - true_um)) < 1.5
    assert np.median(shot.droplets.diameters_raw_um[real] - true_um) > 5


def test_light_from_all_directions_is_no_gaussian_blur() -> None:
    """A sharp lens in diffuse light: by a Gaussian blur droplets would be 3 um too small, in coherent light 10 um.

    Droplets alone do not tell it from light of two apertures; who states it gains what that leaves.
    """
    scene = shadow_scene(SHAPE, 8, IMAGE_SIZE_PX, seed=5, median_mm=0.05, blurs_px=(0.7,) * 4, sharp=True)
    stated, estimated = (
        measure_shadows(scene.images, search_of(scene, margin_voxel=8), light=light)
        for light in ("incoherent", "estimated")
    )
    off_um, raw_off_um, sd_um = [], [], []
    for shot in (stated, estimated):
        assert shot.verdict is ShotVerdict.GOOD
        match, _ = matches(shot.droplets.points_mm, scene.points_mm, scene.grid.pitch_mm)
        assert np.all(match >= 0)
        true_um = 1000 * scene.diameters_mm[match]
        off_um.append(np.median(shot.droplets.diameters_um - true_um))
        raw_off_um.append(np.median(shot.droplets.diameters_raw_um - true_um))
        sd_um.append(np.median(shot.droplets.diameter_sd_um))
    assert abs(off_um[0]) < 0.5
    assert abs(off_um[1]) < 2 * sd_um[1] < 8
    assert max(raw_off_um) < -1.5


def test_a_gaussian_blur_is_told_from_light_that_looks_much_like_it() -> None:
    grid = study_grid(SHAPE)
    scene = size_scene(SizeCase(10), grid, IMAGE_SIZE_PX, np.random.default_rng(6))
    shot = measure_shadows(scene.images, plan_droplets(scene.believed, grid, margin_voxel=8))
    assert shot.verdict is ShotVerdict.GOOD
    assert {view.condenser_ratio for view in shot.views.values()} == {None}
    np.testing.assert_array_equal(shot.droplets.diameters_um, shot.droplets.diameters_raw_um)


def test_light_a_little_wider_than_the_lens_is_not_taken_for_light_from_all_directions() -> None:
    """What is left has a second valley there, in which diameters would be 8 um larger."""
    grid = study_grid(SHAPE)
    scene = size_scene(SizeCase(10, condenser_ratio=1.2), grid, IMAGE_SIZE_PX, np.random.default_rng(5))
    shot = measure_shadows(scene.images, plan_droplets(scene.believed, grid, margin_voxel=8))
    match, _ = matches(shot.droplets.points_mm, scene.spray.positions_mm, grid.pitch_mm)
    off_um = shot.droplets.diameters_um - 1000 * scene.spray.diameters_mm[match]
    assert abs(np.median(off_um[match >= 0])) < 1.5
    assert [view.condenser_ratio for view in shot.views.values()] == pytest.approx([1.2] * 4, abs=0.1)
    assert shot.verdict is ShotVerdict.GOOD


@pytest.mark.parametrize(("ratio", "stated", "sound"), [(1.2, "incoherent", 1.2), (0.8, "gaussian", 0.8)])
def test_a_stated_light_that_droplets_contradict_is_doubted(ratio: float, stated: NamedLight, sound: float) -> None:
    """Diameters are 8 and 10 um too large in it, and nothing else is odd."""
    grid = study_grid(SHAPE)
    scene = size_scene(SizeCase(10, condenser_ratio=ratio), grid, IMAGE_SIZE_PX, np.random.default_rng(5))
    search = plan_droplets(scene.believed, grid, margin_voxel=8)
    assert measure_shadows(scene.images, search, light=sound).verdict is ShotVerdict.GOOD
    doubted = measure_shadows(scene.images, search, light=stated)
    assert doubted.verdict is ShotVerdict.DOUBTFUL
    assert "leave it out, and droplets tell" in doubted.reasons[0]


VALLEYS = {8.0: 2.0, 3.0: 3.0, 1.8: 3.0, 1.3: 1.5, 1.15: 3.0}


@pytest.mark.parametrize(("unit", "gain", "sd"), [(0.1, 1.0, 0.0), (0.1, 60.0, 11.5), (0.02, 1.0, 11.5)])
def test_the_deeper_of_two_valleys_is_taken_and_how_far_the_other_one_lies_is_told(
    unit: float, gain: float, sd: float
) -> None:
    """In one radii are larger by 20; either may be the light where valleys differ by little of what both gain.

    Or of what noise leaves, where both gain little.
    """

    def in_light(other: float | None) -> Relit:
        left = 5.0 + gain * (other is None) if other not in VALLEYS else VALLEYS[other]
        return Relit(np.full(30, np.exp(unit * left)), np.full(30, 20.0 * (other == 8)), Fringes())

    seen = seen_light(in_light)
    assert seen.condenser_ratio == pytest.approx(1.3)
    assert seen.radius_sd == pytest.approx(sd, abs=0.1)


FEW = Fringes(0.1, 0.05)
LOST = Fringes(0.9, 0.5)
THERE = Fringes(0.9, 0.1)


@pytest.mark.parametrize(
    ("fringes", "better", "ratio", "said"),
    [
        (THERE, 30, 0.8, ""),
        (THERE, 12, 0.8, ""),
        (FEW, 30, None, "10 % of its fringes are there"),
        (LOST, 30, None, "fringes would tell, and are lost in noise"),
        (LOST, 15, None, "fringes would tell, and are lost in noise"),
        (FEW, 0, None, ""),
        (THERE, 0, 0.8, ""),
        (LOST, 0, None, "fringes would tell, and are lost in noise"),
    ],
)
def test_light_from_few_directions_is_believed_where_its_fringes_are_seen(
    fringes: Fringes, better: int, ratio: float | None, said: str
) -> None:
    """Larger droplets behind a Gaussian blur, and such that move, look as droplets in light of 0.8 apertures do."""

    def in_light(other: float | None) -> Relit:
        left = np.full(30, 4.0 if other == 0.8 else 8.0)
        if other is None:
            left[:better], left[better:] = 4.1, 3.9
        return Relit(left, np.full(30, 2.0 * (other is None)), fringes if other == 0.8 else Fringes())

    seen = seen_light(in_light)
    assert seen.condenser_ratio == ratio
    assert said in "; ".join(seen.doubts(30)) if said else not seen.doubts(30)
    assert seen.radius_sd == pytest.approx(2 / np.sqrt(3) if said else 0)


def test_the_ratio_that_leaves_least_is_taken_between_those_that_are_tried() -> None:
    def in_light(ratio: float | None) -> Relit:
        left = 9.0 if ratio is None else np.exp(0.4 * (1 / ratio - 1 / 0.37) ** 2)
        return Relit(np.full(30, left), np.zeros(30))

    assert seen_light(in_light).condenser_ratio == pytest.approx(0.37, abs=0.011)


def test_radii_are_as_unsure_as_the_light() -> None:
    """Two lights in which radii differ by 2, and the same or another half of the droplets speaks for either."""
    clear, even = np.full(40, 0.5), np.resize([0.5, 2.0], 40)

    def seen(left: FloatArray) -> SeenLight:
        others = {0.8: left, 0.7: 1 / left, 0.9: np.full(40, 4.0), None: np.full(40, 9.0)}
        return seen_light(lambda ratio: Relit(others.get(ratio, np.full(40, 5.0)), np.full(40, 2.0 * (ratio == 0.7))))

    assert seen(clear).radius_sd == 0
    assert seen(even).radius_sd == pytest.approx(2, rel=0.3)


@pytest.mark.parametrize(("better", "droplets", "ratio"), [(15, 30, None), (24, 30, 0.8), (6, 6, None)])
def test_most_droplets_must_say_so(better: int, droplets: int, ratio: float | None) -> None:
    """Whatever the few that explain the images worst say, and ten droplets at least."""

    def in_light(other: float | None) -> Relit:
        left = np.full(droplets, 2.0)
        left[:better] -= (other or 0) == 0.8
        left[better:] *= 1 if other is None else 100
        return Relit(left, left)

    seen = seen_light(in_light)
    assert seen.condenser_ratio == ratio
    assert seen.share == (better / droplets if droplets > 10 else 0)


def test_who_cannot_tell_the_light_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    grid = study_grid(SHAPE)
    scene = size_scene(SizeCase(7), grid, IMAGE_SIZE_PX, np.random.default_rng(7))
    monkeypatch.setattr("processing.analysis.droplets.shadows.light.seen_light.UNSURE", -0.1)
    shot = measure_shadows(scene.images, plan_droplets(scene.believed, grid, margin_voxel=8))
    assert shot.verdict is ShotVerdict.DOUBTFUL
    assert "--light" in shot.reasons[-1]


def test_few_droplets_do_not_tell_the_light_and_say_so() -> None:
    """Behind a sharp lens they would be 10 um too large without a word."""
    scene = shadow_scene((30, 14, 60), 8, (130, 70))
    stated, estimated = (
        measure_shadows(scene.images, search_of(scene, margin_voxel=8), light=light)
        for light in ("gaussian", "estimated")
    )
    assert 0 < len(stated.droplets) < 10
    assert stated.verdict is ShotVerdict.GOOD
    assert estimated.verdict is ShotVerdict.DOUBTFUL
    assert "fewer than 10 do not vote" in estimated.reasons[-1]


def test_there_and_back_droplets_are_as_they_were() -> None:
    fit = fit_of(None)
    back = relit(relit(fit, 0.7, 1.0), None, 1.0)
    np.testing.assert_allclose(back.discs.radii_voxel, fit.discs.radii_voxel, rtol=1e-6)
    np.testing.assert_allclose(back.optics.variances_px2, fit.optics.variances_px2, rtol=1e-6)


def fit_of(ratio: float | None) -> ShadowFit:
    optics = replace(first_disc_optics([np.eye(70, dtype=np.float32)] * 4), condenser_ratio=ratio)
    discs = Discs(np.full((3, 3), 9.0), np.array([4.0, 9.0, 25.0]))
    return ShadowFit(discs, optics, np.full(4, 0.01))
