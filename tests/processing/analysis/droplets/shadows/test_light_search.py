"""Light that is not incoherent is found, and diameters are corrected for it; incoherent light is left alone."""

from dataclasses import replace

import numpy as np
import pytest

from processing.analysis.droplets.droplet_search import plan_droplets
from processing.analysis.droplets.ghost_share import matches
from processing.analysis.droplets.measured_exposure import ShotVerdict
from processing.analysis.droplets.shadows.disc_optics import first_disc_optics
from processing.analysis.droplets.shadows.light_search import CONDENSER_RATIOS, best_light, relit
from processing.analysis.droplets.shadows.opaque_discs import Discs
from processing.analysis.droplets.shadows.shadow_fit import ShadowFit
from processing.analysis.droplets.shadows.shadow_shot import measure_shadows
from processing.studies.shadows.sizes import SizeCase, size_scene
from processing.studies.simulated_droplets import study_grid

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


def test_the_ratio_that_leaves_least_is_taken_between_those_that_are_tried() -> None:
    fits = {ratio: fit_of(ratio) for ratio in (None, *CONDENSER_RATIOS)}

    def left(fit: ShadowFit) -> float:
        ratio = fit.optics.condenser_ratio
        return 1000.0 if ratio is None else 500 + 4000 * (ratio - 0.37) ** 2

    best = best_light(fits[None], fit_of, left)
    assert best.optics.condenser_ratio == pytest.approx(0.37, abs=0.011)


@pytest.mark.parametrize(("gain", "ratio"), [(20.0, None), (30.0, 1.0)])
def test_light_is_incoherent_unless_another_explains_more(gain: float, ratio: float | None) -> None:
    def left(fit: ShadowFit) -> float:
        return 1000 - gain * ((fit.optics.condenser_ratio or 0.0) == 1.0)

    assert best_light(fit_of(None), fit_of, left).optics.condenser_ratio == ratio


def test_there_and_back_droplets_are_as_they_were() -> None:
    fit = fit_of(None)
    back = relit(relit(fit, 0.7, 1.0), None, 1.0)
    np.testing.assert_allclose(back.discs.radii_voxel, fit.discs.radii_voxel, rtol=1e-6)
    np.testing.assert_allclose(back.optics.variances_px2, fit.optics.variances_px2, rtol=1e-6)


def fit_of(ratio: float | None) -> ShadowFit:
    optics = replace(first_disc_optics([np.eye(70, dtype=np.float32)] * 4), condenser_ratio=ratio)
    discs = Discs(np.full((3, 3), 9.0), np.array([4.0, 9.0, 25.0]))
    return ShadowFit(discs, optics, np.full(4, 0.01))
