"""What tracks show at every width of their filter, what noise alone would show, and the width of least error.

A narrow filter lets noise through, a wide one smooths motion away. Accelerations at many widths show where noise ends
(Voth et al., J. Fluid Mech. 469, 2002; Mordant, Crawford and Bodenschatz, Physica D 193, 2004), to an eye. Here it is
counted. Let v_h be the velocity by a parabola of half window h, and V_h its variance by the covariances of the places.
As v_h is the best linear estimate from its window, and v_1 another one, cov(v_h, v_1) = V_h (Hausman, Econometrica 46,
1978). So <(v_h - v_1)^2> = bias_h^2 + V_1 - V_h as long as v_1 smooths nothing away, and the squared error of v_h is
<(v_h - v_1)^2> - V_1 + 2 V_h. Likewise for accelerations, and by another narrow window than the narrowest. Means <> are
weighted by how exactly the narrowest window knows each droplet, as a few hidden ones would have all the say.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from processing.analysis.velocity.moving_droplets import MovingDroplets
from processing.analysis.velocity.track_motion import SeenPoints, TrackPoints, smoothed
from processing.analysis.velocity.tracks import Tracks
from processing.geometry import FloatArray

MOST_HALF_WINDOW = 20
"""Frames: over more than 41 no path is a parabola."""
MOST_POINTS = 20_000
"""More of them tell nothing new: every n-th track is asked."""
LEAST_POINTS = 100
"""Fewer tell nothing."""
WILD = 6.0
"""Robust standard deviations from the median acceleration, by the narrowest filter: the track has a wrong link."""
NARROW = 3
"""A half window of a third smooths a ninth of the motion away."""
M_PER_MM, UM_PER_MM = 1e-3, 1e3


@dataclass(frozen=True, eq=False)
class NoiseCurve:
    """Of all droplets with one of their track in the frames just before and after; a component, all three together.

    Each droplet counts by how exactly it is known.

    Parameters
    ----------
    half_windows : (H,) int array
        1, 2, 3 and so on, as far as the longest track goes.
    residual_um, residual_noise_um : (H,) arrays
        Standard deviation of places as measured from those on the parabola, and what it is by the covariances alone.
    velocity_m_s, velocity_noise_m_s, acceleration_m_s2, acceleration_noise_m_s2 : (H,) arrays
        That of the motion of all droplets, and what it is by the covariances alone.
    for_velocity, for_acceleration : int
        The half windows of least error.
    """

    half_windows: NDArray[np.intp]
    residual_um: FloatArray
    residual_noise_um: FloatArray
    velocity_m_s: FloatArray
    velocity_noise_m_s: FloatArray
    acceleration_m_s2: FloatArray
    acceleration_noise_m_s2: FloatArray
    for_velocity: int
    for_acceleration: int

    def plain(self) -> dict[str, Any]:
        """Lists and whole numbers by their names, as JSON has them."""
        return {name: np.asarray(value).tolist() for name, value in asdict(self).items()}


def noise_curve(frames: Sequence[MovingDroplets], tracks: Tracks, pitch_mm: float, rate_hz: float) -> NoiseCurve | None:
    """Try all half windows that tracks allow; None where there are too few droplets on tracks.

    Parameters
    ----------
    frames : sequence of MovingDroplets
        As linked.
    tracks : Tracks
        Theirs.
    pitch_mm : float
        Of a voxel.
    rate_hz : float
        Of the frames.
    """
    seen = SeenPoints.of(frames, tracks)
    seen = seen.where(seen.track % (1 + len(seen.track) // MOST_POINTS) == 0)
    (narrowest,) = smoothed(seen, 1)
    chosen = _rightly_linked(narrowest)
    if len(chosen) < LEAST_POINTS:
        return None
    longest = int(np.bincount(seen.track).max())
    widths = np.arange(1, int(np.clip((longest - 1) // 2, 1, MOST_HALF_WINDOW)) + 1)
    weights = 1 / np.sum(narrowest.acceleration_sd[chosen] ** 2, axis=1)
    weights /= weights.sum()
    residuals, motions = [], []
    for points in smoothed(seen, len(widths)):
        residuals.append(_residuals(seen, points, chosen))
        motions.append(_motions(points, chosen))
    velocity, acceleration = (_Smoothed(one[0], one[1], weights) for one in np.moveaxis(np.array(motions), 0, 2))
    residual_um, residual_noise_um = np.sqrt(_mean(np.array(residuals), weights)).T * pitch_mm * UM_PER_MM
    m_s = pitch_mm * M_PER_MM * rate_hz
    return NoiseCurve(
        widths,
        residual_um,
        residual_noise_um,
        velocity.sd * m_s,
        velocity.noise * m_s,
        acceleration.sd * m_s * rate_hz,
        acceleration.noise * m_s * rate_hz,
        velocity.least(),
        acceleration.least(),
    )


def _rightly_linked(narrowest: TrackPoints) -> NDArray[np.intp]:
    """Rows of the points whose motion the narrowest filter knows, on tracks that it believes."""
    known = np.flatnonzero(np.isfinite(narrowest.accelerations[:, 0]))
    if not len(known):
        return known
    accelerations, track = narrowest.accelerations[known], narrowest.track[known]
    scores = np.abs(accelerations - np.median(accelerations, axis=0)) / narrowest.acceleration_sd[known]
    wild = np.any(scores > WILD * 1.4826 * np.median(scores, axis=0), axis=1)
    return known[~np.isin(track, track[wild])]


def _residuals(seen: SeenPoints, points: TrackPoints, chosen: NDArray[np.intp]) -> FloatArray:
    """Squares as seen, and by noise alone, of which a fit takes part away: (2, N, 3)."""
    left = np.einsum("nii->ni", seen.covariance - points.place_covariance)
    squares = (seen.places - points.places) ** 2
    return np.array([squares[chosen], np.maximum(left[chosen], 0)])


def _motions(points: TrackPoints, chosen: NDArray[np.intp]) -> FloatArray:
    """Velocities and accelerations, of either the values and their variances by noise: (2, 2, N, 3)."""
    variances = np.einsum("nii->ni", points.velocity_covariance)
    velocities = points.velocities[chosen], variances[chosen]
    return np.array([velocities, (points.accelerations[chosen], points.acceleration_sd[chosen] ** 2)])


def _mean(squares: FloatArray, weights: FloatArray) -> FloatArray:
    """Of a component, over the droplets."""
    return np.asarray(np.einsum("...ni,n->...", squares, weights) / 3)


@dataclass(frozen=True, eq=False)
class _Smoothed:
    """Velocities or accelerations of all half windows, their variances by noise (H, N, 3), and weights (N,)."""

    values: FloatArray
    variances: FloatArray
    weights: FloatArray

    @property
    def sd(self) -> FloatArray:
        """As seen."""
        means = np.einsum("hni,n->hi", self.values, self.weights)
        return np.asarray(np.sqrt(_mean((self.values - means[:, None]) ** 2, self.weights)))

    @property
    def noise(self) -> FloatArray:
        """Standard deviation by noise alone."""
        return np.asarray(np.sqrt(_mean(self.variances, self.weights)))

    def least(self) -> int:
        """The half window of least error; then, as 1 is noisy, by one that is narrow enough for what was found."""
        return self._least(max(1, self._least(1) // NARROW))

    def _least(self, reference: int) -> int:
        """By a half window that smooths nothing away."""
        values, noise = self.values[reference - 1 :], self.noise[reference - 1 :] ** 2
        squared_errors = _mean((values - values[0]) ** 2, self.weights) - noise[0] + 2 * noise
        return reference + int(np.argmin(squared_errors))
