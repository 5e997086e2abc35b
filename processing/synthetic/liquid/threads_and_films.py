"""Liquid that is no droplet, which a measurement has to tell apart: curved threads and pieces of film in a box."""

import numpy as np

from processing.synthetic.liquid.droplet_clouds import STILL, Box, Flow
from processing.synthetic.spray import LiquidKind, Spray
from processing.synthetic.stamping import FloatArray

_CHAIN_STEP = 0.35
"""Distance of the balls of a thread relative to their diameter, as in the ligaments of a nozzle."""
_FILM_STEP = 0.4
"""The same of a film: each point lies under about five balls."""


def thread(
    start_mm: FloatArray, length_mm: float, diameter_mm: float, rng: np.random.Generator, turn_rad: float = 0.8
) -> FloatArray:
    """Centres (N, 3) of the balls of one curved tube, from its start on.

    Parameters
    ----------
    start_mm : (3,) array
        One end.
    length_mm, diameter_mm : float
        Along the curve, and across.
    rng : numpy Generator
        Source of its directions.
    turn_rad : float
        Standard deviation of the change of its direction over one millimetre, about each axis.
    """
    step_mm = _CHAIN_STEP * diameter_mm
    turns = rng.normal(0, turn_rad * np.sqrt(step_mm), (max(1, round(length_mm / step_mm)), 3))
    first = rng.normal(size=3)
    directions = first / np.linalg.norm(first) + np.cumsum(turns, axis=0)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return np.vstack([start_mm, start_mm + step_mm * np.cumsum(directions, axis=0)])


def threads(
    box: Box,
    count: int,
    rng: np.random.Generator,
    flow: Flow = STILL,
    lengths_mm: tuple[float, float] = (0.3, 1.5),
    diameters_mm: tuple[float, float] = (0.04, 0.09),
) -> Spray:
    """Curved opaque tubes that begin anywhere in a box; each flies as a whole.

    Parameters
    ----------
    box, count, rng, flow
        Where they begin, how many, source of chance, how their starts fly.
    lengths_mm, diameters_mm : (least, most)
        Each as likely as any other between the two.
    """
    parts = [Spray.of_droplets(np.empty((0, 3)), np.empty(0))]
    for start_mm in box.positions_mm(count, rng):
        diameter_mm = rng.uniform(*diameters_mm)
        centres_mm = thread(start_mm, rng.uniform(*lengths_mm), diameter_mm, rng)
        velocity = flow.velocities_mm_per_s(start_mm[None], rng)
        parts.append(_balls(centres_mm, diameter_mm, velocity, LiquidKind.LIGAMENT, 1.0))
    return Spray.joined(parts)


def films(
    box: Box,
    count: int,
    rng: np.random.Generator,
    flow: Flow = STILL,
    radii_mm: tuple[float, float] = (0.3, 1.0),
    opacity: float = 0.08,
) -> Spray:
    """Flat round pieces of film with their middles anywhere in a box, in any direction.

    Parameters
    ----------
    box, count, rng, flow
        Where, how many, source of chance, how their middles fly.
    radii_mm : (least, most)
        Each as likely as any other between the two.
    opacity : float
        Of one ball; face on, about five lie over each point.
    """
    parts = [Spray.of_droplets(np.empty((0, 3)), np.empty(0))]
    for middle_mm in box.positions_mm(count, rng):
        radius_mm, diameter_mm = rng.uniform(*radii_mm), 0.2
        axis = np.arange(-radius_mm, radius_mm, _FILM_STEP * diameter_mm)
        across, along = (values.ravel() for values in np.meshgrid(axis, axis))
        within = np.hypot(across, along) <= radius_mm
        basis, _ = np.linalg.qr(rng.normal(size=(3, 2)))
        centres_mm = middle_mm + np.column_stack([across[within], along[within]]) @ basis.T
        velocity = flow.velocities_mm_per_s(middle_mm[None], rng)
        parts.append(_balls(centres_mm, diameter_mm, velocity, LiquidKind.SHEET, opacity))
    return Spray.joined(parts)


def _balls(centres_mm: FloatArray, diameter_mm: float, velocity: FloatArray, kind: LiquidKind, opacity: float) -> Spray:
    count = len(centres_mm)
    return Spray(
        centres_mm,
        np.full(count, diameter_mm),
        np.repeat(velocity, count, axis=0),
        np.full(count, kind, np.uint8),
        np.full(count, opacity),
    )
