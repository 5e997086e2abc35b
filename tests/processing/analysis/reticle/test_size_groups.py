"""Which dot has which diameter: the order decides, dust is left out, and what does not fit is refused."""

import numpy as np
import pytest

from processing.analysis.reticle.size_groups import IN_ITS_LIGHT, ReticleError, size_groups

TRUE_UM = (20.0, 50.0, 100.0)


def seen(*sizes_um: float, dots: int = 4, spread_um: float = 0.3) -> "np.typing.NDArray[np.float64]":
    rng = np.random.default_rng(3)
    return np.concatenate([size_um + spread_um * rng.standard_normal(dots) for size_um in sizes_um])


def test_dots_that_all_look_too_large_are_still_told_apart() -> None:
    np.testing.assert_array_equal(size_groups(seen(108, 29, 59), TRUE_UM), [2] * 4 + [0] * 4 + [1] * 4)


def test_dust_has_no_diameter() -> None:
    found_um = np.concatenate([seen(20, 50, 100), [73.0, 12.0]])
    np.testing.assert_array_equal(size_groups(found_um, TRUE_UM)[-3:], [2, -1, -1])


@pytest.mark.parametrize("sizes_um", [(50, 100), (20, 50, 100, 200)])
def test_another_number_of_sizes_is_refused_with_those_that_are_seen(sizes_um: tuple[float, ...]) -> None:
    with pytest.raises(ReticleError, match=f"{len(sizes_um)} sizes are seen.* about (20|50)"):
        size_groups(seen(*sizes_um), TRUE_UM)


def test_radii_are_no_diameters() -> None:
    with pytest.raises(ReticleError, match="20 um look as if they had 40 um"):
        size_groups(seen(40, 100, 200), (20.0, 50.0, 100.0))


def test_in_its_own_light_a_dot_looks_as_large_as_it_is() -> None:
    """Diameters that differ by 5 um are those of another reticle, unless the light is unknown."""
    with pytest.raises(ReticleError, match="25 um look as if they had 30 um"):
        size_groups(seen(30, 110), (25.0, 110.0), IN_ITS_LIGHT)
    assert set(size_groups(seen(30, 110), (25.0, 110.0))) == {0, 1}


def test_diameters_that_nobody_could_tell_apart_are_refused() -> None:
    with pytest.raises(ReticleError, match=r"at least 1\.08 times"):
        size_groups(seen(50, 100), (50.0, 52.0))


def test_droplets_are_no_reticle() -> None:
    with pytest.raises(ReticleError, match="no 3 dots of one size are seen in all views: is this the run of a reticle"):
        size_groups(np.geomspace(10, 90, 8), (20.0, 30.0))


@pytest.mark.parametrize("scale", [0.9, 1.1])
def test_diameters_in_another_scale_are_refused_whatever_the_light(scale: float) -> None:
    """Behind a Gaussian blur all dots look larger, but the large ones no more than the small ones."""
    true_um = np.array([40.0, 110.0, 180.0])
    found_um = seen(*(true_um + 11))
    assert set(size_groups(found_um, true_um.tolist())) == {0, 1, 2}
    with pytest.raises(
        ReticleError, match=r"dots of \d+ um look \+\d+ um larger, and those of \d+ um [+-]\d+ um: no light"
    ):
        size_groups(found_um, (scale * true_um).tolist())
