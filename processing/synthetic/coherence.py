"""Light from more or fewer directions: in that from few, small opaque discs look larger than they are.

A droplet's profile is Abbe's sum (``processing.coherent_light``). Everything scales with the Airy disk d_A / M in the
object, so one table of radial profiles per condenser serves all lenses and diameters. What it cannot do:

* The profile is that of a droplet in focus; defocus blurs it as if its rays were independent.
* Neighbours interfere in truth; here each weakens what the other changes. Two discs of 0.6 Airy disks with a condenser
  of 0.2: off by 0.02 at most where they are half an Airy disk apart, by 0.1 where they overlap; the incoherent union
  is off by 0.37.
* Fringes are not smeared along the path of a droplet; refraction is left out.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.special import chndtr

from processing.coherent_light import CORE_SIGMA, MOST_RATIO, blurred, circles, waves
from processing.synthetic.stamping import Discs, FloatArray, FloatImage, stamp_discs

REACH_AIRY = 3.0
"""A profile ends so many Airy disks beyond the edge of its disc."""
_DIAMETERS_AIRY = np.geomspace(0.05, 12.0, 56)
_BLURS_AIRY = np.array([0.0, 0.06, 0.12, 0.2, 0.3, 0.45, 0.7])
_COLUMNS = 160
_DARKEST = 1e-3


@dataclass(frozen=True, eq=False)
class CoherentProfiles:
    """Transmittance of opaque discs, in units of the Airy disk in the object.

    Parameters
    ----------
    profiles : CubicSpline
        Of the logarithm of the diameter: (blurs, columns) against the distance from the middle; the last column lies
        ``REACH_AIRY`` beyond the edge of the disc.
    """

    profiles: CubicSpline

    def of(self, diameters_airy: FloatArray, blurs_airy: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Distances and transmittances (N, columns) of discs under a further Gaussian blur of their own."""
        blur, blur_share = _place(blurs_airy, _BLURS_AIRY)
        wide = self.profiles(np.log(np.clip(diameters_airy, _DIAMETERS_AIRY[0], _DIAMETERS_AIRY[-1])))
        found = np.take_along_axis(wide, blur[:, None, None], axis=1)[:, 0] * (1 - blur_share[:, 0])
        found += np.take_along_axis(wide, blur[:, None, None] + 1, axis=1)[:, 0] * blur_share[:, 0]
        reach_airy = 0.5 * diameters_airy + REACH_AIRY
        return reach_airy[:, None] * np.linspace(0, 1, _COLUMNS), found


def _place(values: FloatArray, nodes: FloatArray) -> tuple[NDArray[np.intp], FloatArray]:
    """Interval of increasing nodes that each value lies in, and where in it, (N, 1, 1); beyond them, the last one."""
    held = np.clip(values, nodes[0], nodes[-1])
    at = np.clip(np.searchsorted(nodes, held, side="right") - 1, 0, len(nodes) - 2)
    return at, ((held - nodes[at]) / (nodes[at + 1] - nodes[at]))[:, None, None]


@lru_cache(maxsize=4)
def coherent_profiles(condenser_ratio: float) -> CoherentProfiles:
    """Table of a condenser: two seconds of work, kept.

    Parameters
    ----------
    condenser_ratio : float
        Numerical aperture of the light over that of the lens: 0.02 is almost coherent, 1 fills the lens, 8
        is light from all directions.
    """
    if not 0 < condenser_ratio <= MOST_RATIO:
        raise ValueError(f"condenser ratio must lie above 0 and not exceed {MOST_RATIO:g}, not {condenser_ratio}")
    profiles = np.array([_profiles(diameter, condenser_ratio) for diameter in _DIAMETERS_AIRY])
    return CoherentProfiles(CubicSpline(np.log(_DIAMETERS_AIRY), profiles))


def _profiles(diameter_airy: float, condenser_ratio: float) -> FloatArray:
    """Means around the disc for each blur, (blurs, columns)."""
    rings = circles()
    spectra = rings.spectrum(diameter_airy, condenser_ratio) * blurred(rings.per_airy, _BLURS_AIRY[:, None])
    distances = (0.5 * diameter_airy + REACH_AIRY) * np.linspace(0, 1, _COLUMNS)
    return np.asarray(1 + spectra @ waves(rings.per_airy, distances), dtype=np.float64)


def with_coherence(transmittance: FloatImage, discs: Discs, airy_px: float, condenser_ratio: float) -> FloatImage:
    """A blurred union of opaque discs as partially coherent light shows it.

    To the union comes, disc by disc, what a lone disc is darker or brighter in partially coherent light, times the
    light that the other discs let through there, times the share of the disc that is seen past them: a lone droplet
    becomes its coherent profile, and one behind a larger one adds nothing.

    Parameters
    ----------
    transmittance : (row, column) float32 array
        The union of the discs, blurred by the Gaussian of incoherent light.
    discs : Discs
        The discs, in the middle of their paths; ``sigmas_px`` is their own blur, defocus and the area of a pixel.
    airy_px : float
        Diameter of the Airy disk.
    condenser_ratio : float
        As in ``coherent_profiles``.
    """
    sigmas_px = np.hypot(CORE_SIGMA * airy_px, discs.sigmas_px)
    blurred = Discs(discs.centres, discs.radii_px, sigmas_px, np.ones(len(sigmas_px)), 0 * discs.smears)
    all_of_them = np.maximum(stamp_discs(blurred, transmittance.shape), _DARKEST)
    distances, coherent = coherent_profiles(condenser_ratio).of(2 * discs.radii_px / airy_px, discs.sigmas_px / airy_px)
    squares = ((distances * airy_px) / sigmas_px[:, None]) ** 2
    lone = 1 - np.nan_to_num(chndtr(((discs.radii_px / sigmas_px) ** 2)[:, None], 2.0, squares))
    result = transmittance.copy()
    for number, centre in enumerate(discs.centres):
        window, radii_px = _window(centre, distances[number, -1] * airy_px, transmittance.shape)
        columns = radii_px / (distances[number, -1] * airy_px) * (_COLUMNS - 1)
        own, change = (
            np.interp(columns, np.arange(_COLUMNS), values, right=rest)
            for values, rest in ((lone[number], 1.0), (coherent[number] - lone[number], 0.0))
        )
        others = np.minimum(all_of_them[window] / np.maximum(own, _DARKEST), 1)
        seen = np.sum(others * (1 - own)) / max(np.sum(1 - own), _DARKEST)
        result[window] += (seen * others * change).astype(np.float32)
    return np.maximum(result, 0)


def _window(centre: FloatArray, reach_px: float, shape: tuple[int, ...]) -> tuple[tuple[slice, slice], FloatArray]:
    """Pixels that a disc reaches, and their distances from its middle."""
    first = np.clip(np.floor(centre - reach_px).astype(int), 0, shape)
    end = np.clip(np.ceil(centre + reach_px).astype(int) + 1, 0, shape)
    rows, columns = (np.arange(a, b) - c for a, b, c in zip(first, end, centre, strict=True))
    return (slice(first[0], end[0]), slice(first[1], end[1])), np.hypot(rows[:, None], columns)
