"""Bright particles of one exposure, found by what the fit has left over, without any truth.

Round by round: candidates where all views have light left enter the fit dark and share the light by themselves; those
that stay dark are dropped; the threshold falls. What droplets look like, the level of the images and a shift of each
are re-estimated meanwhile. Ghosts are mostly faint: when a fit has come to rest, all below half the median are dropped
and found anew, and ghosts do not come back.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import maximum_filter
from scipy.spatial import cKDTree

from processing.analysis.droplets.candidates import candidates, close_pairs, foremost
from processing.analysis.droplets.droplet_search import CANDIDATE_PITCH_VOXEL, DropletSearch, keep_on
from processing.analysis.droplets.gaussian_blobs import BlobImages, BlobOptics, Blobs, Image
from processing.analysis.droplets.point_spread import first_optics, refined_optics
from processing.geometry import FloatArray

MOST_ROUNDS = 160
FALLING_ROUNDS = 6
"""In which the threshold falls from ``FIRST`` to ``LAST`` median amplitudes; after a purge it begins at a quarter."""
FIRST, LAST = 0.6, 0.1
LEAST_GAIN = 0.003
"""A fit is at rest when a round lowers the residual by less than this share."""
PRUNE_FIRST, PRUNE_LAST = 0.08, 0.1
"""Droplets below so many median amplitudes are dropped, at the first and at the last threshold. At the last, 0.3 would
lose one or two of a hundred droplets whose amplitudes spread as exp(N(0, 0.5))."""
LEAST_LEFT = 0.03
"""Spots from so many median amplitudes on are looked for in what droplets leave, and counted as missing: what makes
droplets no round Gaussians leaves less."""
HALO_WIDTHS = 5.0
"""So near to a droplet, in widths of it, what is left may be its halo: of spots with heavy wings it was at 3 to 4."""
COMPLETE, SHARP_POWER = 2.0, 1.5
"""So many times brighter than the faintest that is told nearly all droplets are found; of spots that are narrower than
a pixel, over the power of their width, as candidates stand a little beside them: see ``verdicts.cut_sizes``."""
NOISE_SIGMAS = 5.0
"""No droplet is fainter than so many standard deviations of its amplitude."""
SEEN_FROM_ASIDE = 0.6
"""What is left of a droplet at the nearest candidate of the coarser grid."""
ALONE_SIGMAS = 3.0
"""Of candidates that are closer, only the highest is tried; the others are if light is left."""
APART_VOXEL = 1.2
"""Droplets that are closer become one."""
PURGES, PURGE_BELOW, SETTLED = 16, 0.5, 0.995
"""So often at most droplets below so many median amplitudes are dropped and found anew; it ends when their number falls
no lower than to such a share."""
HOPELESS = 1.5
"""A fit that leaves so many times what it may is not purged: it is refused, however long it would go on."""
MODEL_SHARE = 0.01
"""Of the height of a droplet, to which it is round and Gaussian: without noise, so much may be left of it."""
SWEEPS, FINAL_SWEEPS = 12, 60
TOLERANCE, FINAL_TOLERANCE = 3e-3, 3e-4
OPTICS_EVERY = 3
"""Rounds from one estimate of the optics to the next."""


@dataclass(frozen=True, eq=False)
class BrightFit:
    """Droplets as they explain the images.

    Parameters
    ----------
    blobs : Blobs
        The droplets.
    optics : BlobOptics
        What they look like.
    scale : float
        Their typical amplitude.
    """

    blobs: Blobs
    optics: BlobOptics
    scale: float

    @property
    def faintest(self) -> float:
        """Amplitude below which noise cannot be told from a droplet."""
        return NOISE_SIGMAS * self.optics.amplitude_sigma

    @property
    def told_from(self) -> float:
        """Amplitude of the faintest droplet that is told."""
        return max(PRUNE_LAST * self.scale, self.faintest)

    @property
    def complete_from(self) -> float:
        """Amplitude from which on nearly all droplets are found."""
        return COMPLETE * self.told_from / float(min(1.0, rms_of(self.optics.sigmas_px)) ** SHARP_POWER)

    @property
    def allowed(self) -> FloatArray:
        """Root mean square that may be left of the images (K,): their noise, which is 1, or what the model is off."""
        return np.maximum(1.0, MODEL_SHARE * self.scale * self.optics.gains)

    def brighter_than(self, amplitude: float) -> "BrightFit":
        """Without the droplets that are fainter."""
        return replace(self, blobs=self.blobs.where(self.blobs.amplitudes > amplitude))


def find_bright(shot: BlobImages, search: DropletSearch, before_round: Callable[[], None] = keep_on) -> BrightFit:
    """Find the droplets of one exposure.

    Parameters
    ----------
    shot : BlobImages
        Images whose noise is 1, with the lattice of the search.
    search : DropletSearch
        Where to look: it must hold every droplet that all views show.
    before_round : callable
        Called before each round; what it raises ends the search.
    """
    optics = first_optics(shot.images)
    fit = BrightFit(Blobs.none(), optics, _first_scale(shot.images, optics))
    number, purges, before, known = 0, PURGES, np.inf, np.inf
    for _ in range(MOST_ROUNDS):
        before_round()
        fit, left = _round(shot, search, fit, number)
        at_rest = number >= FALLING_ROUNDS and left > (1 - LEAST_GAIN) * before
        number, before = number + 1, left
        if not at_rest:
            continue
        if left > HOPELESS * rms_of(fit.allowed):
            break
        purged = fit.brighter_than(PURGE_BELOW * fit.scale)
        if not purges or len(purged.blobs) == len(fit.blobs) or len(fit.blobs) > SETTLED * known:
            break
        known = len(fit.blobs)
        fit, purges, number = _fitted(shot, purged), purges - 1, FALLING_ROUNDS // 4
    return _finished(shot, fit)


def fainter(shot: BlobImages, search: DropletSearch, fit: BrightFit) -> Blobs:
    """Spots that all views see apart from the droplets, fainter than any that is told; none where noise hides them.

    Parameters
    ----------
    shot, search : BlobImages, DropletSearch
        As they were searched.
    fit : BrightFit
        What was found: it stays as it is.
    """
    least = max(LEAST_LEFT * fit.scale, fit.faintest)
    if least >= fit.told_from:
        return Blobs.none()
    residuals = shot.residuals(fit.optics, fit.blobs)
    dark = replace(fit, blobs=Blobs.none().joined_by(_new_places(shot, search, fit, residuals, least)))
    lit = merged(_fitted(shot, dark, residuals=residuals).brighter_than(least).blobs, APART_VOXEL)
    if not len(fit.blobs):
        return lit
    apart_voxel = cKDTree(fit.blobs.positions_voxel).query(lit.positions_voxel)[0]
    return lit.where(np.asarray(apart_voxel > HALO_WIDTHS * rms_of(fit.optics.sigmas_px)))


def _round(shot: BlobImages, search: DropletSearch, fit: BrightFit, number: int) -> tuple[BrightFit, float]:
    """One round at its threshold; the fit, and the root mean square of what is left."""
    fallen = min(1.0, number / (FALLING_ROUNDS - 1))
    residuals = shot.residuals(fit.optics, fit.blobs)
    places = _new_places(shot, search, fit, residuals, max(FIRST * fit.scale * (LAST / FIRST) ** fallen, fit.faintest))
    grown = replace(fit, blobs=fit.blobs.joined_by(places))
    grown = _fitted(shot, grown, move=False, residuals=residuals)
    prune = (PRUNE_FIRST + (PRUNE_LAST - PRUNE_FIRST) * fallen) * fit.scale
    for least in (0.25 * prune, prune):
        grown = _fitted(shot, grown.brighter_than(max(least, 0.7 * fit.faintest)))
    blobs = merged(grown.blobs, APART_VOXEL)
    blobs = blobs.where(search.reaches(blobs.positions_voxel))
    if len(blobs):
        grown = replace(fit, blobs=blobs, scale=_typical(blobs.amplitudes))
        if number % OPTICS_EVERY == 0:
            grown = replace(grown, optics=refined_optics(shot, grown.optics, blobs, shifts=number > 0))
    else:
        grown = replace(fit, blobs=blobs)
    return grown, rms(shot.residuals(grown.optics, grown.blobs))


def _new_places(
    shot: BlobImages, search: DropletSearch, fit: BrightFit, residuals: Sequence[Image], threshold: float
) -> FloatArray:
    """Candidates that are no droplets as yet, (N, 3) in voxels of the searched grid."""
    peaks = candidates(search.plan, residuals, fit.optics.gains, SEEN_FROM_ASIDE * threshold, shot.threads)
    alone = foremost(peaks, ALONE_SIGMAS * float(fit.optics.sigmas_px.mean()) / CANDIDATE_PITCH_VOXEL)
    places = CANDIDATE_PITCH_VOXEL * alone[:, :3]
    if not len(fit.blobs) or not len(places):
        return places
    distance_voxel = cKDTree(fit.blobs.positions_voxel).query(places)[0]
    return np.asarray(places[distance_voxel > APART_VOXEL], dtype=np.float64)


def _fitted(
    shot: BlobImages,
    fit: BrightFit,
    *,
    sweeps: int = SWEEPS,
    tolerance: float = TOLERANCE,
    move: bool = True,
    residuals: Sequence[Image] | None = None,
) -> BrightFit:
    blobs = shot.fitted(
        fit.optics, fit.blobs, sweeps=sweeps, scale=fit.scale, tolerance=tolerance, move=move, residuals=residuals
    )
    return replace(fit, blobs=blobs)


def _finished(shot: BlobImages, fit: BrightFit) -> BrightFit:
    if len(fit.blobs):
        fit = replace(fit, optics=refined_optics(shot, fit.optics, fit.blobs, shifts=True))
        fit = _fitted(shot, fit, sweeps=FINAL_SWEEPS, tolerance=FINAL_TOLERANCE)
    return fit.brighter_than(fit.told_from)


def rms(images: Sequence[Image]) -> float:
    """Root mean square of all pixels."""
    squares = sum(float(np.vdot(image, image)) for image in images)
    return float(np.sqrt(squares / sum(image.size for image in images)))


def rms_of(values: FloatArray) -> float:
    """Root mean square of a few values."""
    return float(np.sqrt(np.mean(values**2)))


def _first_scale(images: Sequence[Image], optics: BlobOptics) -> float:
    """Median amplitude of what stands out of the noise in the images, before anything is fitted."""
    tops = []
    for image, gain, level in zip(images, optics.gains, optics.levels, strict=True):
        lit = image - level
        tops.append(lit[(lit == maximum_filter(lit, 3)) & (lit > 6)] / gain)
    heights = np.concatenate(tops)
    return _typical(heights) if len(heights) else 1.0


def _typical(amplitudes: FloatArray) -> float:
    """Median of the amplitudes from half the median on."""
    return float(np.median(amplitudes[amplitudes >= 0.5 * np.median(amplitudes)]))


def merged(blobs: Blobs, apart_voxel: float) -> Blobs:
    """Pairs of blobs that are closer become one, brightest first; where it is, their light decides."""
    order = np.argsort(-blobs.amplitudes, kind="stable")
    positions, amplitudes = blobs.positions_voxel[order], blobs.amplitudes[order]
    kept = np.ones(len(order), bool)
    for one, other in close_pairs(positions, apart_voxel):
        if kept[one] and kept[other]:
            total = amplitudes[one] + amplitudes[other]
            share = amplitudes[other] / total if total > 0 else 0.0
            positions[one] += share * (positions[other] - positions[one])
            amplitudes[one], kept[other] = total, False
    return Blobs(positions[kept], amplitudes[kept])
