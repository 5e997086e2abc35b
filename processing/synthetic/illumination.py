"""What a view shows without spray: its uneven light, and the dust on its windows. Fixed per view and seed."""

import numpy as np

from processing.synthetic.stamping import Discs, FloatImage, stamp_discs

_DUST_GRAINS = 18
_DUST_RADIUS_RANGE_PX = (2.0, 14.0)
"""Of an image 1600 px wide."""


def light_field(shape: tuple[int, int], seed: int | list[int]) -> FloatImage:
    """Smooth brightness of an LED's collimated beam: a bright spot off the centre, a slope, broad waves.

    Parameters
    ----------
    shape : tuple[int, int]
        (rows, columns).
    seed : int or list of int
        Equal seeds give equal fields.

    Returns
    -------
    (row, column) float32 array
        Brightness with mean 1, about 0.6 in the corners and 1.2 in the middle.
    """
    rng = np.random.default_rng(seed)
    y = np.linspace(-0.75, 0.75, shape[0], dtype=np.float32)[:, None]
    x = np.linspace(-1, 1, shape[1], dtype=np.float32)[None, :]
    centre_x, centre_y = rng.uniform(-0.2, 0.2, 2)
    field = np.exp(-((x - centre_x) ** 2 + (y - centre_y) ** 2) / 2.2)
    field = field * (1 + rng.uniform(-0.08, 0.08) * x + rng.uniform(-0.08, 0.08) * y)
    for _ in range(3):
        wave_x, wave_y, phase = *rng.uniform(-2.5, 2.5, 2), rng.uniform(0, 2 * np.pi)
        field = field * (1 + 0.03 * np.cos(wave_x * x + wave_y * y + phase))
    return np.asarray(field / field.mean(), dtype=np.float32)


def dust_transmittance(shape: tuple[int, int], seed: int | list[int]) -> FloatImage:
    """Transmittance 0..1 of dusty windows: blurred dark spots that no spray and no target moves.

    Parameters
    ----------
    shape : tuple[int, int]
        (rows, columns).
    seed : int or list of int
        Equal seeds give equal dust.
    """
    rng = np.random.default_rng(seed)
    scale = shape[1] / 1600
    smallest_px, largest_px = _DUST_RADIUS_RANGE_PX
    radii_px = scale * smallest_px * (largest_px / smallest_px) ** rng.uniform(0, 1, _DUST_GRAINS)
    grains = Discs(
        centres=rng.uniform(0, 1, (_DUST_GRAINS, 2)) * (np.array(shape) - 1),
        radii_px=radii_px,
        sigmas_px=radii_px * rng.uniform(0.3, 0.8, _DUST_GRAINS),
        opacities=rng.uniform(0.15, 0.6, _DUST_GRAINS),
        smears=np.zeros((_DUST_GRAINS, 2)),
    )
    return stamp_discs(grains, shape)
