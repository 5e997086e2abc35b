"""Droplets of a series in time whose tracks are known: labels are drawn first, and no code of the product is asked."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from processing.analysis.velocity.moving_droplets import MovingDroplets
from processing.geometry import FloatArray

BOX = np.array([250.0, 80.0, 160.0])


@dataclass(frozen=True, eq=False)
class Series:
    """Frames, which true droplet each droplet is (-1: a ghost), and true velocities and accelerations per frame."""

    frames: list[MovingDroplets]
    labels: list[NDArray[np.intp]]
    velocities: list[FloatArray]
    accelerations: FloatArray


def series(
    seed: int = 1,
    density_per_mm3: float = 28.0,
    frames: int = 12,
    *,
    step: tuple[float, float, float] = (4.0, 3.0, 1.5),
    scatter: float = 0.15,
    turn: float = 0.02,
    gradient: float = 0.006,
    found: float = 0.985,
    ghosts: float = 0.005,
    noise: float = 0.035,
) -> Series:
    """Droplets that fly through a box with gradients, each with an acceleration of its own; some are missed."""
    rng = np.random.default_rng(seed)
    beyond = np.abs(step) * frames * 1.5 + 10
    places = rng.uniform(-beyond, BOX + beyond, (round(density_per_mm3 / 60**3 * np.prod(BOX + 2 * beyond)), 3))
    velocities = step + (places - BOX / 2) @ rng.normal(0, gradient, (3, 3)).T + rng.normal(0, scatter, places.shape)
    accelerations, log_sizes = rng.normal(0, turn, places.shape), rng.normal(0, 0.5, len(places))
    out = Series([], [], [], accelerations)
    for _ in range(frames):
        _expose(out, places, velocities, log_sizes, (found, ghosts, noise), rng)
        places = places + velocities + accelerations / 2
        velocities = velocities + accelerations
    return out


def _expose(
    out: Series,
    places: FloatArray,
    velocities: FloatArray,
    log_sizes: FloatArray,
    quality: tuple[float, float, float],
    rng: np.random.Generator,
) -> None:
    found, ghosts, noise = quality
    inside = np.all((places > 0) & (places < BOX), axis=1)
    labels = np.flatnonzero(inside & (rng.random(len(places)) < found))
    invented = rng.binomial(len(labels), ghosts)
    there = np.vstack([places[labels] + rng.normal(0, noise, (len(labels), 3)), rng.uniform(0, BOX, (invented, 3))])
    looks = np.append(log_sizes[labels] + rng.normal(0, 0.03, len(labels)), rng.normal(0, 0.5, invented))
    covariance = np.tile(noise**2 * np.eye(3), (len(there), 1, 1))
    order = rng.permutation(len(there))
    out.frames.append(MovingDroplets(there, covariance, looks).where(order))
    out.labels.append(np.append(labels, np.full(invented, -1))[order])
    out.velocities.append(velocities)
