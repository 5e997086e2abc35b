"""What figures by volume lack where larger droplets than all that were seen carry volume.

A bootstrap draws the droplets that were seen, so it knows of no larger ones: of samples of a broad spray most lack
those that carry its volume, and all their draws do. So sprays are drawn whose logarithms of diameters are normal. Their
spread is that of the **upper half** of the sample, as well as so many droplets tell it: smaller ones, which may be cut
off, say nothing of larger ones. Each is sampled as often as there are droplets. How far figures of these samples are
off those of their sprays is how far the measured figure may be off: a parametric bootstrap (Efron and Tibshirani, An
introduction to the bootstrap, ch. 6), with the parameter itself drawn.
"""

from dataclasses import dataclass

import numpy as np

from processing.analysis.estimates import SEED, Estimate
from processing.geometry import FloatArray

DRAWS = 300
REACH, CLASSES = 6.0, 480
"""Standard deviations, to both sides, in classes of 0.025: droplets are counted in these, however many there are."""
KNOWN_BY = 0.7
"""Of the upper half, degrees of freedom of its spread about the median, which is not known for sure either."""
FEWEST = 5


@dataclass(frozen=True, eq=False)
class DrawnSprays:
    """Samples of lognormal sprays of median 1.

    Parameters
    ----------
    spreads : (rows,) array
        Standard deviation of ln d of each spray.
    levels : (classes,) array
        ln d of the droplets of each class, in standard deviations.
    counts : (rows, classes) array
        Droplets of each sample.
    """

    spreads: FloatArray
    levels: FloatArray
    counts: FloatArray

    @property
    def by_volume(self) -> FloatArray:
        """Volumes of the classes of each sample, (rows, classes); the largest class of each row may have 1."""
        powers = 3 * self.spreads[:, None] * self.levels
        return np.asarray(self.counts * np.exp(powers - powers.max(axis=1, keepdims=True)))


def drawn_sprays(diameters_um: FloatArray, exposures_per_shot: float = 1.0) -> DrawnSprays | None:
    """Sprays that a sample may be of, and samples of them; None where diameters do not differ, or are few.

    Parameters
    ----------
    diameters_um : (N,) array
        Of the sample.
    exposures_per_shot : float
        2 where exposures A and B show the same droplets.
    """
    logs = np.log(diameters_um)
    above = (logs - np.median(logs))[logs > np.median(logs)]
    if len(above) < FEWEST * exposures_per_shot:
        return None
    rng, droplets = np.random.default_rng(SEED), round(len(logs) / exposures_per_shot)
    freedom = KNOWN_BY * len(above) / exposures_per_shot
    spreads = np.sqrt(np.mean(above**2) * freedom / rng.chisquare(freedom, DRAWS))
    levels = REACH * (2 * (np.arange(CLASSES) + 0.5) / CLASSES - 1)
    shares = np.exp(-(levels**2) / 2)
    return DrawnSprays(spreads, levels, rng.multinomial(droplets, shares / shares.sum(), DRAWS).astype(np.float64))


def with_unseen(told: Estimate, off: FloatArray, confidence: float) -> Estimate:
    """An estimate above 0 with an interval that is nowhere narrower than samples are off the sprays that they are of.

    Parameters
    ----------
    told : Estimate
        Of the measured sample.
    off : (rows,) array
        Logarithm of the figure of each sample, less that of its spray.
    confidence : float
        Of the interval.
    """
    most, least = np.quantile(off, [(1 + confidence) / 2, (1 - confidence) / 2])
    low, high = float(told.value * np.exp(-most)), float(told.value * np.exp(-least))
    return told.no_surer_than(Estimate(value=told.value, low=low, high=high))


def de_brouckere_off(sprays: DrawnSprays) -> FloatArray:
    """Logarithm of D43 of each sample less that of its spray, exp(3.5 s^2), (rows,)."""
    volumes, steps = sprays.by_volume, sprays.spreads[:, None] * sprays.levels
    means = np.sum(volumes * np.exp(steps), axis=1) / np.sum(volumes, axis=1)
    return np.asarray(np.log(means) - 3.5 * sprays.spreads**2)
