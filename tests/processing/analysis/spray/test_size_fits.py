"""Fits against the distributions that they are of: moments by gamma functions, quantiles by scipy."""

import numpy as np
import pytest
from scipy.special import gamma
from scipy.stats import lognorm, weibull_min

from processing.analysis.droplets.size_statistics import mean_diameters
from processing.analysis.estimates import reach
from processing.analysis.spray.sample_size import MOST_EXTREME, sample_verdict, shots_needed
from processing.analysis.spray.size_fits import SizeFit, size_fits
from processing.analysis.spray.spray_sample import SpraySample, spray_sample
from tests.support.sampled_sprays import stored_shot

N = 4000
SHARES = (np.arange(N) + 0.5) / N


def rosin_rammler_um(scale_um: float = 80.0, q: float = 4.0) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """Diameters whose volumes follow Rosin and Rammler: q above 3, so that their number is finite.

    By number their density is ``d^(q - 4) exp(-(d / X)^q)``: ``(d / X)^q`` is gamma distributed, of order (q - 3) / q.
    """
    rng = np.random.default_rng(5)
    return np.asarray(scale_um * rng.gamma((q - 3) / q, 1, 10 * N) ** (1 / q))


def sample_of(diameters_um: np.ndarray[tuple[int, ...], np.dtype[np.float64]], shots: int = 10) -> SpraySample:
    return spray_sample([stored_shot(diameters_um[shot::shots], shot=shot) for shot in range(shots)])


def by_name(sample: SpraySample) -> dict[str, SizeFit]:
    return {fit.name: fit for fit in size_fits(sample)}


def test_a_lognormal_spray_is_found_and_the_other_one_does_not_fit() -> None:
    sample = sample_of(lognorm.ppf(SHARES, 0.35, scale=40))
    fits = by_name(sample)
    assert next(iter(fits)) == "lognormal"
    fit = fits["lognormal"]
    assert fit.shape == pytest.approx(0.35, rel=0.03)
    assert fit.scale_um == pytest.approx(40 * np.exp(3 * 0.35**2), rel=0.01)
    assert fit.d32_um == pytest.approx(40 * np.exp(2.5 * 0.35**2), rel=0.01)
    assert (fit.fits, fits["rosin-rammler"].fits) == (True, False)
    d_um = np.array([20.0, 60.0, 90.0])
    by_volume = lognorm(fit.shape, scale=fit.scale_um)
    np.testing.assert_allclose(fit.cumulative(d_um), by_volume.cdf(d_um))
    np.testing.assert_allclose(fit.density_per_um(d_um), by_volume.pdf(d_um))


def test_two_shots_of_one_distribution_fit_it() -> None:
    """Two shots have three draws, which lie closer to what was measured than droplets by chance do."""
    sprays = [lognorm.rvs(0.4, scale=40, size=200, random_state=seed) for seed in range(20)]
    assert sum(by_name(sample_of(d_um, shots=2))["lognormal"].fits for d_um in sprays) >= 19


def test_a_spray_of_rosin_and_rammler_has_their_exponent_and_moments_by_gamma_functions() -> None:
    d_um = rosin_rammler_um()
    fits = by_name(sample_of(d_um))
    assert next(iter(fits)) == "rosin-rammler"
    fit = fits["rosin-rammler"]
    assert (fit.scale_um, fit.shape) == pytest.approx((80, 4), rel=0.02)
    assert fit.d32_um == pytest.approx(80 / gamma(1 - 1 / 4), rel=0.02)
    assert fit.d32_um == pytest.approx(np.sum(d_um**3) / np.sum(d_um**2), rel=0.01)
    assert fit.dv50_um == pytest.approx(weibull_min(4, scale=80).median(), rel=0.02)
    assert (fit.fits, fits["lognormal"].fits) == (True, False)
    by_volume = weibull_min(fit.shape, scale=fit.scale_um)
    np.testing.assert_allclose(fit.cumulative(np.array([30.0, 90.0])), by_volume.cdf([30.0, 90.0]))
    np.testing.assert_allclose(fit.density_per_um(np.array([30.0, 90.0])), by_volume.pdf([30.0, 90.0]))


@pytest.mark.parametrize("law", ["lognormal", "rosin-rammler"])
def test_intervals_hold_the_parameters_that_sprays_have(law: str) -> None:
    held: list[tuple[bool, bool]] = []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        if law == "lognormal":
            d_um, truth = rng.lognormal(np.log(40), 0.3, 1500), (40 * np.exp(3 * 0.3**2), 0.3)
        else:
            d_um, truth = 80 * rng.gamma(1 - 3 / 5, 1, 1500) ** (1 / 5), (80, 5)
        fit = by_name(sample_of(d_um, shots=6))[law]
        scale_um, shape = fit.scale_within_um, fit.shape_within
        assert scale_um is not None
        assert shape is not None
        assert (scale_um.value, shape.value) == pytest.approx((fit.scale_um, fit.shape), rel=2e-3)
        held.append((scale_um.low <= truth[0] <= scale_um.high, shape.low <= truth[1] <= shape.high))
    assert np.mean(held, axis=0) == pytest.approx([0.95, 0.95], abs=0.11)


def test_fewer_than_20_diameters_are_not_fitted() -> None:
    assert size_fits(sample_of(np.linspace(10, 20, 19), shots=2)) == ()


def test_a_large_sample_is_adequate_and_one_with_an_extreme_droplet_is_not() -> None:
    d_um = lognorm.ppf(SHARES, 0.3, scale=40)
    adequate = _verdict(np.random.default_rng(0).permutation(d_um))
    assert (adequate.verdict, adequate.reasons) == ("adequate", ())
    assert adequate.extreme_share
    assert adequate.extreme_share < MOST_EXTREME
    extreme = _verdict(np.append(d_um, 400.0))
    assert extreme.verdict == "low sample"
    assert "the largest droplet has" in " ".join(extreme.reasons)
    assert extreme.extreme_um == 400
    assert extreme.d32_without_extreme_um == pytest.approx(np.sum(d_um**3) / np.sum(d_um**2))


def test_a_few_shots_say_how_many_it_would_take() -> None:
    few = _verdict(np.random.default_rng(0).permutation(lognorm.ppf(SHARES[::40], 0.3, scale=40)), shots=4)
    assert few.verdict == "low sample"
    assert few.shots_for_5_percent
    assert few.shots_for_5_percent > 4
    assert f"about {few.shots_for_5_percent} shots would do" in few.reasons[-1]


def test_more_shots_do_not_tell_the_light() -> None:
    d_um = np.random.default_rng(0).permutation(lognorm.ppf(SHARES, 0.3, scale=40))
    sizes = mean_diameters([d_um[shot::10] for shot in range(10)])
    assert sizes.d32_um is not None
    unsure = sizes.model_copy(
        update={"light_sd_um": 3.0, "d32_um": sizes.d32_um.less_sure(1.96 * 3 / sizes.d32_um.value)}
    )
    known, told = (sample_verdict(sample_of(d_um, 10), one) for one in (sizes, unsure))
    assert told.shots_for_5_percent == known.shots_for_5_percent
    assert told.verdict == "low sample"
    assert "3.0 um (one standard deviation), as the light is not known" in told.reasons[-1]
    assert "shots would do" not in told.reasons[-1]


@pytest.mark.parametrize("shots", [2, 3, 5, 40])
def test_few_shots_do_not_ask_for_more_than_many_that_scatter_alike(shots: int) -> None:
    """A scatter of 12 % needs 25 shots: 2.06 times 12 % over 5 is 5 %; few shots have a far larger t themselves."""
    half_width = 0.12 * reach(shots) / np.sqrt(shots)
    assert shots_needed(half_width, shots) == 25


def test_two_shots_that_are_alike_need_as_many_as_their_droplets_do() -> None:
    """Chance made them alike: between them is next to no scatter, and a D32 of 60 droplets is not known to 5 %."""
    d_um = np.repeat(lognorm.ppf((np.arange(60) + 0.5) / 60, 0.4, scale=40), 2)
    alike = _verdict(d_um, shots=2)
    assert alike.d32_half_width is not None
    assert alike.shots_for_5_percent == pytest.approx(2 * (alike.d32_half_width / 0.05) ** 2, rel=0.3)
    assert _verdict(np.repeat(np.linspace(39, 41, 60), 2), shots=2).shots_for_5_percent == 5


def _verdict(d_um: np.ndarray[tuple[int, ...], np.dtype[np.float64]], shots: int = 10):  # type: ignore[no-untyped-def]
    return sample_verdict(sample_of(d_um, shots), mean_diameters([d_um[shot::shots] for shot in range(shots)]))
