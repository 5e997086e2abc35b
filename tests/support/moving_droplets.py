"""Droplets of two exposures whose partners are known: labels are drawn first, and no code of the product is asked."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from processing.analysis.velocity.moving_droplets import MovingDroplets
from processing.geometry import FloatArray

BOX = np.array([300.0, 80.0, 200.0])
MARGIN = 30.0


@dataclass(frozen=True, eq=False)
class Exposed:
    """Droplets of an exposure, and which true droplet each is; -1 is a ghost."""

    droplets: MovingDroplets
    labels: NDArray[np.intp]

    def reordered(self, order: NDArray[np.intp]) -> "Exposed":
        seen = self.droplets
        return Exposed(
            MovingDroplets(seen.places[order], seen.covariance[order], seen.log_sizes[order]), self.labels[order]
        )

    def placed(self, places: FloatArray) -> "Exposed":
        return replace(self, droplets=replace(self.droplets, places=places))


def exposures(
    seed: int = 1,
    density_per_mm3: float = 28.0,
    *,
    shift: tuple[float, float, float] = (10.0, 3.0, -5.0),
    scatter: float = 0.3,
    found: float = 1.0,
    ghosts: float = 0.0,
    noise: float = 0.04,
    unlikeness: float = 0.03,
) -> tuple[Exposed, Exposed]:
    """Droplets in a box and around it that fly with gradients, and what two exposures see of them within the box."""
    rng = np.random.default_rng(seed)
    places = rng.uniform(-MARGIN, BOX + MARGIN, (round(density_per_mm3 / 60**3 * np.prod(BOX + 2 * MARGIN)), 3))
    gradients = rng.normal(0, 0.01, (3, 3))
    moved = places + shift + (places - BOX / 2) @ gradients.T + rng.normal(0, scatter, places.shape)
    log_sizes = rng.normal(0, 0.5, len(places))
    seen = []
    for there in (places, moved):
        looks = log_sizes + rng.normal(0, unlikeness, len(places))
        seen.append(_seen(there, looks, found, ghosts, noise, rng))
    return seen[0], seen[1]


def _seen(
    places: FloatArray, log_sizes: FloatArray, found: float, ghosts: float, noise: float, rng: np.random.Generator
) -> Exposed:
    (labels,) = np.nonzero(np.all((places > 0) & (places < BOX), axis=1) & (rng.random(len(places)) < found))
    invented = rng.binomial(len(labels), ghosts)
    there = np.vstack([places[labels] + rng.normal(0, noise, (len(labels), 3)), rng.uniform(0, BOX, (invented, 3))])
    sizes = np.append(log_sizes[labels], rng.normal(0, 0.5, invented))
    covariance = np.tile(noise**2 * np.eye(3), (len(there), 1, 1))
    seen = Exposed(MovingDroplets(there, covariance, sizes), np.append(labels, np.full(invented, -1)))
    return seen.reordered(rng.permutation(len(there)))


def right(first: Exposed, second: Exposed, own: NDArray[np.intp], other: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Which pairs are of one true droplet."""
    return np.asarray((first.labels[own] == second.labels[other]) & (first.labels[own] >= 0))


def in_both(first: Exposed, second: Exposed) -> int:
    """True droplets that both exposures show."""
    return len(np.intersect1d(first.labels[first.labels >= 0], second.labels[second.labels >= 0]))
