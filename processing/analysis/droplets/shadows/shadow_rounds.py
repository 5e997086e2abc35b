"""The rounds of a search for shadows: candidates enter, all are fitted, some are dropped, optics are estimated anew."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from processing.analysis.droplets.candidates import foremost
from processing.analysis.droplets.droplet_search import CANDIDATE_PITCH_VOXEL, DropletSearch, keep_on
from processing.analysis.droplets.gaussian_blobs import Image
from processing.analysis.droplets.shadows.discs.disc_optics import refined_disc_optics
from processing.analysis.droplets.shadows.discs.disc_supports import DiscSupports, supporting_views, undisputed
from processing.analysis.droplets.shadows.discs.merged_discs import merged_discs
from processing.analysis.droplets.shadows.discs.opaque_discs import (
    NO_DISC,
    DiscImages,
    DiscOptics,
    Discs,
    Shadows,
    Sweeps,
)
from processing.analysis.droplets.shadows.judged_volume import judging_views, knowing_views
from processing.analysis.droplets.shadows.light.fringes import fringes_of
from processing.analysis.droplets.shadows.light.light_search import LEAST_BLUR_PX, Relit, seen_light
from processing.analysis.droplets.shadows.light.seen_light import SeenLight
from processing.analysis.droplets.shadows.masked_liquid import liquid_masks, liquid_objects
from processing.analysis.droplets.shadows.relit_discs import relit
from processing.analysis.droplets.shadows.shadow_candidates import Stage, shadow_peaks
from processing.analysis.droplets.shadows.shadow_fit import (
    ShadowFit,
    Transmissions,
    residuals,
    rms_over_noise,
    seen_by,
)
from processing.analysis.droplets.shadows.shadow_union import union_defects
from processing.geometry import FloatArray

LAST = 0.04
"""Missing share of the light from which on a candidate is tried at last."""
SHARP_PX = 0.6
LEAST_GAIN, MOST_ROUNDS = 0.003, 20
"""The fit is at rest when a round lowers the residual by less than this share, or after so many rounds."""
NOISE_SIGMAS, SIGNIFICANCE = 4.0, 5.0
"""No candidate is fainter than so many standard deviations of its shadow, and no droplet than of its squared radius."""
COARSE_LEAST, SHARP_LEAST = 0.15, 0.5
"""Droplets with a fainter shadow are dropped: absolute, and as a share of the threshold."""
RELIT_ROUNDS = 2
"""In which droplets, blur and level become those of another light."""
SETTLING_ROUNDS, SETTLED_BLUR = 8, 1e-3
"""In which the last droplets and their blur are fitted in turns, or until no blur changes by a larger share. Either
explains much of what the other does: before, 37 droplets of 25 um were told 2 % too large behind a blur 4 % too wide.
"""
MASKED_ROUNDS = 2
"""For droplets that most views see through masks: they explain what is left, and are not told."""
OPTICS_EVERY = 2
"""Rounds from one estimate of optics and defects to the next."""
APART_VOXEL, APART_RADII = 1.2, 0.7
"""A candidate keeps so far from droplets, or so many radii of theirs."""
SWEEPS = (Sweeps(4, move=False, tolerance=0.01), Sweeps(8, tolerance=0.01))
FINAL_SWEEPS = Sweeps(30, tolerance=3e-4)


class ShadowRounds:
    """The rounds of a search, all with the same images."""

    def __init__(self, shot: Transmissions, search: DropletSearch, before_round: Callable[[], None] = keep_on) -> None:
        self._shot = shot
        self._before_round = before_round
        self._search = search
        self._into_grid = shot.cut(search.pixels_into_grid())
        self._last: tuple[Discs, DiscOptics, list[Image]] | None = None

    def fallen(self, fit: ShadowFit, first: float, rounds: int, *, joker: bool) -> ShadowFit:
        """Rounds with a falling threshold."""
        last = _last(fit)
        for number, threshold in enumerate(np.geomspace(max(first, last), last, rounds)):
            unite = joker or number >= rounds // 2
            fit = self.round(
                fit,
                Stage(SHARP_PX, float(threshold), joker=joker, hidden=joker and number % OPTICS_EVERY == 0),
                estimate=number % OPTICS_EVERY == 1,
                unite=unite,
            )
        return fit

    def rested(self, fit: ShadowFit) -> ShadowFit:
        """Rounds at the last threshold until they explain no more."""
        stage = Stage(SHARP_PX, _last(fit), joker=True, hidden=True)
        left, before = self._left(fit), np.inf
        for _ in range(MOST_ROUNDS):
            if left > (1 - LEAST_GAIN) * before:
                break
            fit = self.round(fit, stage, estimate=True, unite=True)
            left, before = self._left(fit), left
        return fit

    def light(self, fit: ShadowFit) -> SeenLight:
        """What the droplets say of the light."""
        return seen_light(lambda ratio: self.in_light(fit, ratio), resolved=self.resolves_light(fit))

    def in_light(self, fit: ShadowFit, condenser_ratio: float | None) -> Relit:
        """The droplets in some light, what it leaves around each, and how much of its fringes is there."""
        other = self.relit(fit, condenser_ratio)
        shadows = self.shadows(other)
        seen = seen_by(self._shot, other, shadows.transmissions)
        squares = seen.supports(shadows, other.optics, other.discs).residual ** 2
        return Relit(squares, other.discs.radii_voxel, fringes_of(seen, shadows))

    def resolves_light(self, fit: ShadowFit) -> bool:
        """Whether pixels are fine enough to tell the light."""
        return self._blur_px(fit) >= LEAST_BLUR_PX

    def relit(self, fit: ShadowFit, condenser_ratio: float | None) -> ShadowFit:
        """The very same droplets in other light, fitted to it."""
        if not len(fit.discs):
            return fit
        return self.settled(relit(fit, condenser_ratio, self._shot.lattice.pixels_per_voxel))

    def left_around(self, fit: ShadowFit) -> FloatArray:
        """What is left around each droplet, squared, once the very same droplets are fitted to the images."""
        return self._supports(self.settled(fit)).residual ** 2

    def shadows(self, fit: ShadowFit) -> Shadows:
        """What its droplets let through."""
        return self._recorded().drawn(fit.optics, fit.discs)

    def settled(self, fit: ShadowFit, rounds: int = RELIT_ROUNDS, sweeps: Sweeps = SWEEPS[1]) -> ShadowFit:
        """The very same droplets and the optics, fitted in turns: so often, or until no blur changes."""
        for _ in range(rounds):
            self._before_round()
            shadows = self.shadows(fit)
            seen = seen_by(self._shot, fit, shadows.transmissions)
            discs, _ = seen.fitted(shadows, fit.optics, fit.discs, sweeps)
            before_px, fit = self._blurs_px(fit), self._estimated(fit.with_discs(discs), unite=False)
            if np.all(abs(self._blurs_px(fit) / before_px - 1) < SETTLED_BLUR):
                break
        return fit

    def round(self, fit: ShadowFit, stage: Stage, *, estimate: bool, unite: bool = False) -> ShadowFit:
        """Candidates enter, all are fitted, some are dropped; then optics and defects are estimated anew."""
        self._before_round()
        fit = self._fitted(self._joined(fit, stage), stage)
        if stage.joker and len(fit.discs):
            least = np.clip(self._knowing(fit), 1, judging_views(len(self._shot.images)))
            fit = fit.where(supporting_views(self._supports(fit)) >= least)
        if estimate and len(fit.discs):
            fit = self._estimated(self._masked(fit) if unite else fit, unite=unite)
        return fit

    def _masked(self, fit: ShadowFit) -> ShadowFit:
        """Discs in a row, and those that touch what has been found to be liquid before, are no droplets."""
        known = len(fit.liquid)
        liquid = liquid_objects(fit.liquid.joined_by(fit.discs.positions_voxel, fit.discs.squares_voxel2))[known:] >= 0
        if not liquid.any():
            return fit
        more = fit.discs.where(liquid)
        joined = fit.liquid.joined_by(more.positions_voxel, more.squares_voxel2)
        masks = liquid_masks(joined, self._shot.lattice, fit.optics, [image.shape for image in self._shot.images])
        return replace(fit.where(~liquid), liquid=joined, masks=masks)

    def undisputed(self, fit: ShadowFit) -> ShadowFit:
        """Without the droplets that some view disputes."""
        return fit.where(undisputed(self._supports(fit)))

    def finished(self, fit: ShadowFit) -> ShadowFit:
        """The droplets in place, all of them significant, and those that masks leave too few views for."""
        for _ in range(MASKED_ROUNDS if fit.masks else 0):
            fit = self.round(fit, Stage(SHARP_PX, _last(fit), joker=True, masked=True), estimate=True, unite=True)
        if not len(fit.discs):
            return fit
        fit = self.settled(fit, SETTLING_ROUNDS, FINAL_SWEEPS)
        seen = self._seen(fit)
        discs, information = seen.fitted(seen.drawn(fit.optics, fit.discs), fit.optics, fit.discs, FINAL_SWEEPS)
        return fit.with_discs(discs.where(_significant(discs, information)))

    def _joined(self, fit: ShadowFit, stage: Stage) -> ShadowFit:
        drawn = self._drawn(fit)
        seen = seen_by(self._shot, fit, drawn)
        peaks = shadow_peaks(self._search.plan, seen, drawn, stage, self._shot.windows)
        blur_voxel = self._blur_voxel(fit)
        width_voxel = float(np.hypot(blur_voxel, stage.smooth_px))
        alone = foremost(peaks, max(1.0, 1.5 * width_voxel / CANDIDATE_PITCH_VOXEL))
        places = CANDIDATE_PITCH_VOXEL * alone[:, :3]
        squares = np.full(len(places), NO_DISC)
        if stage.coarse:
            squares = -np.log(1 - np.minimum(alone[:, 3], 0.95)) * width_voxel**2
        if len(fit.discs) and len(places):
            distance, near = cKDTree(fit.discs.positions_voxel).query(places)
            free = distance > np.maximum(APART_VOXEL, APART_RADII * fit.discs.radii_voxel[near])
            places, squares = places[free], squares[free]
        return fit.with_discs(fit.discs.joined_by(places, squares))

    def _fitted(self, fit: ShadowFit, stage: Stage) -> ShadowFit:
        least = COARSE_LEAST if stage.coarse else SHARP_LEAST * stage.threshold
        shadows = self.shadows(fit)
        seen = seen_by(self._shot, fit, shadows.transmissions)
        discs = fit.discs
        for sweeps in SWEEPS:
            discs, information = seen.fitted(shadows, fit.optics, discs, sweeps)
            kept = (self._depths(fit, discs) > least) & _significant(discs, information)
            seen.add(shadows, fit.optics, discs.where(~kept), -1.0)
            discs = discs.where(kept)
            if sweeps is SWEEPS[0]:
                seen = replace(seen, weights=seen_by(self._shot, fit, shadows.transmissions).weights)
        discs = merged_discs(discs)
        return fit.with_discs(discs.where(self._search.reaches(discs.positions_voxel)))

    def _estimated(self, fit: ShadowFit, *, unite: bool) -> ShadowFit:
        seen = self._seen(fit)
        judging = replace(seen, weights=tuple(map(np.multiply, seen.weights, self._into_grid)))
        fit = replace(fit, optics=refined_disc_optics(judging, fit.optics, fit.discs, self._drawn(fit)))
        if unite:
            fit = replace(fit, defects=union_defects(seen, fit.optics, fit.discs))
            drawn = self._drawn(fit)
            left = residuals(seen_by(self._shot, fit, drawn), drawn)
            fit = replace(fit, noises=fit.optics.levels * self._shot.masked(fit.masks).noises_of(left))
        return fit

    def _recorded(self) -> DiscImages:
        """The images as they are, where weights do not matter."""
        return DiscImages(self._shot.images, self._shot.trust, self._shot.lattice, self._shot.threads)

    def _seen(self, fit: ShadowFit) -> DiscImages:
        return seen_by(self._shot, fit, self._drawn(fit))

    def _supports(self, fit: ShadowFit) -> DiscSupports:
        shadows = self.shadows(fit)
        return seen_by(self._shot, fit, shadows.transmissions).supports(shadows, fit.optics, fit.discs)

    def _knowing(self, fit: ShadowFit) -> NDArray[np.int64]:
        return knowing_views(self._shot, fit, fit.discs.positions_voxel)

    def _left(self, fit: ShadowFit) -> float:
        return rms_over_noise(self._seen(fit), self._drawn(fit))

    def _drawn(self, fit: ShadowFit) -> list[Image]:
        """Transmissions of its discs; the last ones are kept, because a round asks for the same ones again."""
        if self._last is None or self._last[0] is not fit.discs or self._last[1] is not fit.optics:
            self._last = (fit.discs, fit.optics, self._recorded().drawn(fit.optics, fit.discs).transmissions)
        return self._last[2]

    def _blurs_px(self, fit: ShadowFit) -> FloatArray:
        lattice = self._shot.lattice
        return fit.optics.blurs_px(0.5 * (lattice.nodes_px.shape[1] - 1) * lattice.spacing)

    def _blur_px(self, fit: ShadowFit) -> float:
        return float(self._blurs_px(fit).mean())

    def _blur_voxel(self, fit: ShadowFit) -> float:
        return self._blur_px(fit) / self._shot.lattice.pixels_per_voxel

    def _depths(self, fit: ShadowFit, discs: Discs) -> FloatArray:
        """Share of the light that discs take at their centres."""
        return np.asarray(1 - np.exp(-discs.squares_voxel2 / (2 * self._blur_voxel(fit) ** 2)))


def _last(fit: ShadowFit) -> float:
    """Threshold up to which candidates are shadows and not noise."""
    return max(LAST, NOISE_SIGMAS * fit.amplitude_sigma)


def _significant(discs: Discs, information: FloatArray) -> NDArray[np.bool_]:
    return np.asarray(discs.squares_voxel2 * np.sqrt(information) > SIGNIFICANCE)
