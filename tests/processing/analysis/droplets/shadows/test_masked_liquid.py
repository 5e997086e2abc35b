"""Ligaments and films of the simulator among droplets: they are masked, what lies beside them is measured."""

from dataclasses import dataclass

import numpy as np
import pytest

from processing.analysis.cells import measured_shares
from processing.analysis.droplets.droplet_search import plan_droplets
from processing.analysis.droplets.ghost_share import matches
from processing.analysis.droplets.measured_exposure import ShotVerdict
from processing.analysis.droplets.shadows.discs.opaque_discs import Discs
from processing.analysis.droplets.shadows.masked_liquid import liquid_objects, lumps
from processing.analysis.droplets.shadows.shadow_shot import ShadowExposure, measure_shadows
from processing.analysis.spray.spray_sample import bounds_mm
from processing.geometry import FloatArray, PinholeCamera
from processing.studies.simulated_droplets import study_cameras, study_grid
from processing.synthetic.liquid.droplet_clouds import Box, LogNormal, droplet_cloud
from processing.synthetic.liquid.threads_and_films import films
from processing.synthetic.paper_rig import paper_optics
from processing.synthetic.shadow_shots import Counting, transmission_images
from processing.synthetic.spray import LiquidKind, Spray
from processing.synthetic.stamping import FloatImage

GRID = study_grid((120, 30, 200))
IMAGE_SIZE_PX, MARGIN_VOXEL = (280, 80), 12


@dataclass(frozen=True, eq=False)
class Scene:
    spray: Spray
    cameras: list[PinholeCamera]
    images: list[FloatImage]

    @property
    def droplets(self) -> Spray:
        return self.spray.of_kind(LiquidKind.DROPLET)

    def measured(self, order: tuple[int, ...] = (0, 1, 2, 3)) -> ShadowExposure:
        search = plan_droplets([self.cameras[k] for k in order], GRID, margin_voxel=MARGIN_VOXEL)
        return measure_shadows([self.images[k] for k in order], search)


def scene_of(*liquid: Spray, density_per_mm3: float = 8, seed: int = 3) -> Scene:
    rng, cameras = np.random.default_rng(seed), study_cameras(IMAGE_SIZE_PX)
    cloud = droplet_cloud(Box.around(GRID), density_per_mm3, LogNormal(), rng)
    spray = Spray.joined([cloud, *liquid])
    return Scene(
        spray,
        cameras,
        transmission_images(cameras, list(paper_optics().values()), spray, Counting.of_noise(0.012), rng),
    )


def tube(centres_mm: FloatArray, diameter_mm: float) -> Spray:
    count = len(centres_mm)
    kinds = np.full(count, LiquidKind.LIGAMENT, np.uint8)
    return Spray(centres_mm, np.full(count, diameter_mm), np.zeros((count, 3)), kinds, np.ones(count))


def droplets_at(*rows: tuple[float, float, float, float]) -> Spray:
    """Of (x, y, z, diameter) in mm."""
    table = np.array(rows)
    return Spray.of_droplets(table[:, :3], table[:, 3])


@pytest.fixture(scope="module")
def ligament() -> Spray:
    """Curved, 0.9 mm long and 60 um thick, so that it stays within the middle of the grid."""
    s_mm = np.arange(-0.45, 0.45, 0.02)
    return tube(np.column_stack([s_mm, 0.12 * np.cos(4 * s_mm), 0.5 * s_mm**2]), 0.06)


@pytest.fixture(scope="module")
def scene(ligament: Spray) -> Scene:
    return scene_of(ligament)


@pytest.fixture(scope="module")
def shot(scene: Scene) -> ShadowExposure:
    return scene.measured()


def ghosts_and_missed(scene: Scene, shot: ShadowExposure) -> tuple[int, Spray]:
    """Told droplets that are none, and those from 20 um on that are not told."""
    truth = scene.droplets
    within = truth.inside(GRID)
    of_told, _ = matches(shot.droplets.points_mm, truth.positions_mm, GRID.pitch_mm)
    _, of_truth = matches(shot.droplets.points_mm, within.positions_mm, GRID.pitch_mm)
    return int(np.count_nonzero(of_told < 0)), within.where((of_truth < 0) & (within.diameters_mm > 0.02))


def test_a_ligament_is_masked_and_droplets_beside_it_are_found(
    scene: Scene, shot: ShadowExposure, ligament: Spray
) -> None:
    ghosts, missed = ghosts_and_missed(scene, shot)
    assert (shot.verdict, ghosts) == (ShotVerdict.GOOD, 0)
    assert shot.hidden.liquid_objects == 1
    assert 0 < shot.hidden.volume_share < 0.25
    assert shot.hidden.measured_percent
    for percent in shot.hidden.measured_percent.values():
        assert np.mean(percent) == pytest.approx(100 * (1 - shot.hidden.volume_share), abs=1)
        assert np.max(percent) == 100, "a ligament hides what is near it"
    shares = measured_shares([[shot.told()]], bounds_mm(GRID))
    assert set(shares) == set(shot.hidden.measured_percent), "cells of voxels are those of the box"
    assert len(missed) <= 2 + shot.hidden.volume_share * len(scene.droplets)
    assert len(shot.droplets) > 0.75 * len(scene.droplets.inside(GRID))
    apart_mm = np.linalg.norm(shot.droplets.points_mm[:, None] - ligament.positions_mm[None], axis=2)
    assert apart_mm.min() > 0.03
    assert all(0 < view.masked < 0.4 for view in shot.views.values())


def test_the_order_of_views_does_not_matter_beside_a_ligament(scene: Scene, shot: ShadowExposure) -> None:
    other = scene.measured((2, 0, 3, 1))
    match, missed = matches(other.droplets.points_mm, shot.droplets.points_mm, 0.2 * GRID.pitch_mm)
    assert other.hidden.liquid_objects == shot.hidden.liquid_objects
    assert other.hidden.volume_share == pytest.approx(shot.hidden.volume_share, abs=0.01)
    assert np.mean(match >= 0) > 0.95
    assert np.mean(missed >= 0) > 0.95


def test_a_droplet_behind_a_ligament_is_told_by_the_other_views_or_not_at_all(ligament: Spray) -> None:
    """In the sight of views 2 and 3 each, so that three views see one, and of both, so that two do."""
    azimuths_rad = np.deg2rad([15.0, -15.0])
    behind = [
        (0.2 + 0.9 * np.sin(angle_rad), 0.12 * np.cos(0.8), 0.02 + 0.9 * np.cos(angle_rad), 0.05)
        for angle_rad in azimuths_rad
    ]
    scene = scene_of(ligament, droplets_at(*behind), density_per_mm3=3)
    shot = scene.measured()
    assert shot.hidden.liquid_objects == 1
    assert ghosts_and_missed(scene, shot)[0] == 0


def test_a_film_is_masked_or_the_shot_is_not_good() -> None:
    rng = np.random.default_rng(5)
    film = films(Box((-0.1, -0.02, -0.1), (0.1, 0.02, 0.1)), 1, rng, radii_mm=(0.25, 0.26), opacity=0.25)
    scene = scene_of(film, density_per_mm3=5)
    shot = scene.measured()
    ghosts, _ = ghosts_and_missed(scene, shot)
    assert shot.verdict is not ShotVerdict.GOOD or (shot.hidden.liquid_objects > 0 and ghosts <= 1)


def test_large_and_overlapping_droplets_are_not_masked() -> None:
    """150 um alone; two that touch in space; six in a row in the sight of a view, apart in space."""
    row = [(0.6 + 0.2 * np.sin(np.pi / 12) * k, -0.1, 0.2 * np.cos(np.pi / 12) * k, 0.05) for k in range(-3, 3)]
    apart = droplets_at((-0.8, 0.05, 0, 0.15), (0.02, 0.1, 0.3, 0.06), (0.06, 0.12, 0.31, 0.05), *row)
    scene = scene_of(apart, density_per_mm3=3)
    shot = scene.measured()
    ghosts, missed = ghosts_and_missed(scene, shot)
    assert (shot.verdict, shot.hidden.liquid_objects, shot.hidden.volume_share) == (ShotVerdict.GOOD, 0, 0)
    assert (ghosts, len(missed)) == (0, 0)


@pytest.mark.parametrize(
    ("positions_voxel", "is_liquid"),
    [
        ([[0, 0, 0], [2, 0, 0], [4, 1, 0], [6, 2, 0]], True),
        ([[0, 0, 0], [2, 0, 0]], False),
        ([[0, 0, 0], [2, 0, 0], [1, 1.5, 0]], False),
        ([[0, 0, 0], [3, 0, 0], [6, 0, 0], [9, 0, 0]], False),
    ],
    ids=["in a row", "two", "three in a heap", "apart"],
)
def test_discs_are_liquid_where_they_touch_in_a_row(positions_voxel: list[list[float]], is_liquid: bool) -> None:
    count = len(positions_voxel)
    far_voxel = [[50.0, 0.0, 0.0]]
    discs = Discs(np.array([*positions_voxel, *far_voxel], dtype=float), np.full(count + 1, 1.0))
    assert (liquid_objects(discs) >= 0).tolist() == [*[is_liquid] * count, False]


def test_objects_are_numbered() -> None:
    row = np.array([[0, 0, 0], [2, 0, 0], [4, 0, 0]], dtype=float)
    discs = Discs(np.vstack([row, row + 30, [[100, 100, 100]]]), np.ones(7))
    assert liquid_objects(discs).tolist() == [0, 0, 0, 1, 1, 1, -1]
    assert liquid_objects(Discs.none()).tolist() == []


def test_discs_that_touch_and_explain_badly_are_a_lump() -> None:
    pair = np.array([[0, 0, 0], [1.2, 0, 0]], dtype=float)
    discs = Discs(np.vstack([pair, pair + 30, [[60, 0, 0], [62.1, 0, 0]]]), np.ones(6))
    assert lumps(discs, np.array([2, 2, 2, 1.1, 2, 2], dtype=float)).tolist() == [0, 0, -1, -1, -1, -1]
    assert lumps(Discs.none(), np.empty(0)).tolist() == []


def test_three_discs_within_one_another_are_a_lump_however_well_they_explain_it() -> None:
    """Droplets do not go through each other; two may be off by chance."""
    row = np.array([[0, 0, 0], [1.5, 0, 0], [3.0, 0, 0]])
    discs = Discs(np.vstack([row, row[:2] + 30, row * 1.3 + 60]), np.ones(8))
    assert lumps(discs, np.ones(8)).tolist() == [0, 0, 0, -1, -1, -1, -1, -1]


def test_a_short_thread_is_no_row_of_droplets() -> None:
    """As long as two and a half diameters: discs explain it within the noise."""
    s_mm = np.arange(-0.05, 0.051, 0.01)
    thread = tube(np.column_stack([s_mm, 0 * s_mm, 0 * s_mm]), 0.06)
    scene = scene_of(thread)
    shot = scene.measured()
    near_mm = np.linalg.norm(shot.droplets.points_mm[:, None] - thread.positions_mm, axis=2).min(axis=1)
    assert not np.any(near_mm < 0.05)
    assert shot.hidden.liquid_objects == 1
    assert ghosts_and_missed(scene, shot)[0] == 0
