"""A reticle by an oracle: diameters as they are, whatever the view and the light; anything else is refused."""

import numpy as np
import pytest

from processing.analysis.reticle.reticle_sizes import measure_reticle
from processing.analysis.reticle.size_groups import ReticleError
from processing.calibration.droplets.droplet_matching import Box
from tests.support.reticle_scenes import reticle_scene

BOX = Box((-2, -2, -1), (2, 2, 1))
DIAMETERS_UM = (40.0, 110.0)


@pytest.mark.parametrize(("ratio", "light"), [(0.8, 0.8), (None, "incoherent")])
def test_dots_are_as_large_as_they_are_in_every_view(ratio: float | None, light: float) -> None:
    scene = reticle_scene(ratio, diameters_um=DIAMETERS_UM, columns=4)
    found = measure_reticle(scene.images, scene.cameras, BOX, DIAMETERS_UM, light=light)
    for group, true_um in zip(found.groups, DIAMETERS_UM, strict=True):
        assert group.dots == 4
        assert group.found_um == pytest.approx(true_um, abs=0.5)
        np.testing.assert_allclose(group.views_um, true_um, atol=0.8)
        assert group.sd_um < 0.3
    assert found.residual < 0.01
    np.testing.assert_allclose(found.middle_mm, 0, atol=0.01)
    across, down = np.array([np.cos(0.06), 0, -np.sin(0.06)]), np.array([0, np.cos(0.1), np.sin(0.1)])
    np.testing.assert_allclose(found.normal, np.cross(across, down) / np.linalg.norm(np.cross(across, down)), atol=0.02)


def test_in_another_light_the_same_dots_look_larger() -> None:
    """So the light goes with the sizes: droplets are measured in the same one."""
    scene = reticle_scene(0.8, diameters_um=DIAMETERS_UM, columns=4)
    found = measure_reticle(scene.images, scene.cameras, BOX, DIAMETERS_UM, light="gaussian")
    assert min(group.found_um - group.true_um for group in found.groups) > 6


def test_where_no_light_shows_another_scale_is_refused() -> None:
    """Behind an unsharp lens dots look as large as they are: a tenth more is none of the light's."""
    scene = reticle_scene("gaussian", diameters_um=(60.0, 130.0), columns=5)
    with pytest.raises(ReticleError, match="66 um look as if they had 60 um"):
        measure_reticle(scene.images[:3], scene.cameras[:3], BOX, (66.0, 143.0))


def test_few_dots_do_not_tell_the_light() -> None:
    scene = reticle_scene(0.8, diameters_um=DIAMETERS_UM, columns=3)
    with pytest.raises(ReticleError, match="6 dots do not tell"):
        measure_reticle(scene.images, scene.cameras, BOX, DIAMETERS_UM)


def test_dots_that_views_do_not_share_are_refused() -> None:
    scene = reticle_scene(0.8, diameters_um=DIAMETERS_UM, columns=4)
    with pytest.raises(ReticleError, match="dots lie on one plane in all views, which see 8, 8, 8, 0"):
        measure_reticle([*scene.images[:3], np.ones_like(scene.images[3])], scene.cameras, BOX, DIAMETERS_UM)


def test_dots_that_are_not_black_are_refused() -> None:
    """Without its dark image, or of dots that let a tenth through, diameters would be 6 um too small."""
    scene = reticle_scene(0.8, diameters_um=DIAMETERS_UM, columns=4)
    images = [np.float32(0.9) * image + np.float32(0.1) for image in scene.images]
    with pytest.raises(ReticleError, match="7 % of the light is left where dots should be black, limit 4 %"):
        measure_reticle(images, scene.cameras, BOX, DIAMETERS_UM, light=0.8)


def test_one_view_tells_no_plane() -> None:
    scene = reticle_scene(0.8, diameters_um=DIAMETERS_UM, columns=4)
    with pytest.raises(ReticleError, match="2 views at least"):
        measure_reticle(scene.images[:1], scene.cameras[:1], BOX, DIAMETERS_UM, light=0.8)
