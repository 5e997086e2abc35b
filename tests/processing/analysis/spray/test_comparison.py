"""Comparisons: chance is not called significant more often than it says, and what differs is."""

import numpy as np
import pytest

from processing.analysis.droplets.droplet_file import StoredDroplets
from processing.analysis.droplets.sizes_in_light import in_its_light
from processing.analysis.spray.comparison import _holm, differences
from processing.analysis.spray.spray_statistics import spray_statistics
from tests.support.sampled_sprays import stored_shot


def run(rng: np.random.Generator, median_um: float = 40.0, shots: int = 8) -> list[StoredDroplets]:
    made = []
    for shot in range(shots):
        medians = median_um * np.exp(0.05 * rng.standard_normal())
        made.append(stored_shot(medians * np.exp(0.25 * rng.standard_normal(rng.poisson(60))), shot=shot))
    return made


def test_runs_of_one_spray_seldom_differ_in_anything() -> None:
    rng = np.random.default_rng(0)
    called = 0
    for _ in range(30):
        found = differences({name: spray_statistics(run(rng)) for name in ("monday", "tuesday")})
        assert {one.figure for one in found} >= {"d32_um", "number_density_per_mm3", "liquid_ppm"}
        called += any(one.significant for one in found)
    assert called <= 5, "1.5 are expected, more than 5 have 0.3 %"


def test_a_larger_spray_is_larger() -> None:
    rng = np.random.default_rng(1)
    runs = {"fine": spray_statistics(run(rng)), "coarse": spray_statistics(run(rng, 50.0))}
    found = {one.figure: one for one in differences(runs)}
    d32 = found["d32_um"]
    assert (d32.first, d32.second, d32.significant) == ("fine", "coarse", True)
    assert d32.ratio.low < 1.25 < d32.ratio.high
    assert not found["number_density_per_mm3"].significant
    assert all(one.p_value <= one.p_corrected <= 1 for one in found.values())


def test_what_the_light_is_not_known_to_hides_no_difference() -> None:
    """Both runs are in it: it makes their diameters wrong, but wrong alike."""
    rng = np.random.default_rng(1)
    runs = {name: spray_statistics(run(rng, median_um)) for name, median_um in (("fine", 40.0), ("coarse", 50.0))}
    unsure = {
        name: one.model_copy(update={"droplets": one.droplets.model_copy(update=dict(in_its_light(one.droplets, 5.0)))})
        for name, one in runs.items()
    }
    assert unsure["fine"].droplets.d32_um != runs["fine"].droplets.d32_um
    sure = {one.figure: one.p_value for one in differences(runs)}
    assert {one.figure: one.p_value for one in differences(unsure)} == pytest.approx(sure)


def test_a_run_of_one_shot_is_not_compared() -> None:
    rng = np.random.default_rng(2)
    assert differences({"one": spray_statistics(run(rng, shots=1)), "many": spray_statistics(run(rng))}) == ()


def test_holms_correction_is_that_of_the_paper() -> None:
    assert _holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert _holm([]) == []
