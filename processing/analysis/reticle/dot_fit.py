"""Diameters of dots in one view, with the blur that all of them share: Gauss-Newton, the dots eliminated one by one."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from processing.analysis.droplets.gaussian_blobs import Image
from processing.analysis.droplets.shadows.discs.disc_profiles import DiscProfiles
from processing.analysis.droplets.shadows.shadow_light import BLACK
from processing.analysis.reticle.elliptic_dots import Ellipse, elliptic_dot
from processing.geometry import FloatArray

STEPS, SETTLED = 25, 1e-4
"""At most; and the relative change of all diameters at which it ends."""
MOST_CHANGE, MOST_STEP_PX = 0.3, 0.5
"""Of radius and blur in one step, relative; of the middle."""
STEP = 1e-3
"""Of numerical derivatives: relative, of positions in pixels."""
AROUND_PX = 2.0
"""Pixels are asked so far beyond the reach of the profiles."""
LEAST_BLUR_PX, MOST_BLUR_PX = 0.3, 8.0


@dataclass(frozen=True, eq=False)
class Dot:
    """A dot in an image.

    Parameters
    ----------
    ellipse : Ellipse
        Its outline.
    middle_px : (2,) array
        Column and row.
    level : float
        Light around it.
    """

    ellipse: Ellipse
    middle_px: FloatArray
    level: float = 1.0

    def drawn(self, profiles: DiscProfiles, blur_px: float, points_px: FloatArray) -> FloatArray:
        """Light (N,) at points (N, 2)."""
        return self.level * elliptic_dot(profiles, self.ellipse, blur_px, points_px - self.middle_px)

    def moved(self, step: FloatArray) -> "Dot":
        """Changed by a relative radius, column, row and level (4,)."""
        grown = self.ellipse.scaled(1 + float(np.clip(step[0], -MOST_CHANGE, MOST_CHANGE)))
        shift_px = np.clip(step[1:3], -MOST_STEP_PX, MOST_STEP_PX)
        return Dot(grown, self.middle_px + shift_px, self.level + float(step[3]))


@dataclass(frozen=True, eq=False)
class FittedDots:
    """Dots of one view as they fit.

    Parameters
    ----------
    dots : tuple of Dot
        In the order given.
    blur_px : float
        Standard deviation of the blur.
    squares : (N,) array
        Mean squared residual of each dot, relative to its light.
    greys : (M,) array
        Share of the light that is left at pixels where dots should be black.
    """

    dots: tuple[Dot, ...]
    blur_px: float
    squares: FloatArray
    greys: FloatArray


def fit_dots(image: Image, dots: Sequence[Dot], blur_px: float, profiles: DiscProfiles) -> FittedDots:
    """Fit diameters, middles and levels of dots, and their common blur.

    Parameters
    ----------
    image : (rows, columns) float32 array
        Light over that of the background.
    dots : sequence of Dot
        Where to begin; their shapes are kept.
    blur_px : float
        Where to begin.
    profiles : DiscProfiles
        Of the light.
    """
    reach_px = profiles.reach * blur_px + AROUND_PX
    places = [_Place.of(image, dot, reach_px, _neighbours(dots, number, reach_px)) for number, dot in enumerate(dots)]
    found = FittedDots(tuple(dots), blur_px, np.zeros(len(dots)), np.zeros(0))
    for _ in range(STEPS):
        before = np.array([dot.ellipse.major_px for dot in found.dots])
        found = _improved(found, places, profiles)
        if np.all(np.abs([dot.ellipse.major_px for dot in found.dots] / before - 1) < SETTLED):
            break
    return found


def _neighbours(dots: Sequence[Dot], number: int, reach_px: float) -> tuple[int, ...]:
    """Dots that reach into the pixels of one."""
    here = dots[number]
    gaps_px = (
        np.linalg.norm(dot.middle_px - here.middle_px) - dot.ellipse.major_px - here.ellipse.major_px for dot in dots
    )
    return tuple(other for other, gap_px in enumerate(gaps_px) if other != number and gap_px < 2 * reach_px)


@dataclass(frozen=True, eq=False)
class _Place:
    """Pixels around a dot: where (N, 2), their light (N,), and which other dots reach there."""

    points_px: FloatArray
    light: FloatArray
    neighbours: tuple[int, ...]

    @classmethod
    def of(cls, image: Image, dot: Dot, around_px: float, neighbours: tuple[int, ...]) -> "_Place":
        reach_px = dot.ellipse.major_px + around_px
        (left, top), (right, bottom) = np.floor(dot.middle_px - reach_px), np.ceil(dot.middle_px + reach_px)
        rows = np.arange(max(int(top), 0), min(int(bottom) + 1, image.shape[0]))
        columns = np.arange(max(int(left), 0), min(int(right) + 1, image.shape[1]))
        v, u = (axis.ravel() for axis in np.meshgrid(rows, columns, indexing="ij"))
        points_px = np.column_stack([u, v]).astype(np.float64)
        near = np.linalg.norm(points_px - dot.middle_px, axis=1) <= reach_px
        return cls(points_px[near], image[v[near], u[near]].astype(np.float64), neighbours)


def _improved(found: FittedDots, places: Sequence[_Place], profiles: DiscProfiles) -> FittedDots:
    """After one step; what the dots do not explain by themselves moves the blur."""
    fits = [_Linear.of(number, found, place, profiles) for number, place in enumerate(places)]
    bend, pull = (sum(getattr(fit, name) for fit in fits) for name in ("bend", "pull"))
    step = float(np.clip(pull / bend if bend > 0 else 0, -MOST_CHANGE, MOST_CHANGE))
    blur_px = float(np.clip(found.blur_px * (1 + step), LEAST_BLUR_PX, MOST_BLUR_PX))
    dots = tuple(dot.moved(fit.step(step)) for dot, fit in zip(found.dots, fits, strict=True))
    squares, greys = np.array([fit.square for fit in fits]), np.concatenate([fit.greys for fit in fits])
    return FittedDots(dots, blur_px, squares, greys)


@dataclass(frozen=True, eq=False)
class _Linear:
    """One dot, linear around its place: the best step without a change of the blur, and with one of 1."""

    alone: FloatArray
    by_blur: FloatArray
    bend: float
    pull: float
    square: float
    greys: FloatArray

    @classmethod
    def of(cls, number: int, found: FittedDots, place: _Place, profiles: DiscProfiles) -> "_Linear":
        dot, others = found.dots[number], np.ones(len(place.light))
        for other in place.neighbours:
            others *= replace(found.dots[other], level=1.0).drawn(profiles, found.blur_px, place.points_px)

        def lit(by: Dot, relative_blur: float = 1.0) -> FloatArray:
            return others * by.drawn(profiles, relative_blur * found.blur_px, place.points_px)

        drawn = lit(dot)
        changed = [
            *(lit(dot.moved(step)) for step in STEP * np.eye(4)[:3]),
            (1 + STEP / dot.level) * drawn,
            lit(dot, 1 + STEP),
        ]
        slopes, left = (np.column_stack(changed) - drawn[:, None]) / STEP, place.light - drawn
        own, blurring = slopes[:, :4], slopes[:, 4]
        alone, by_blur = np.linalg.lstsq(own, np.column_stack([left, -blurring]), rcond=None)[0].T
        beyond, shares = blurring + own @ by_blur, left / dot.level
        greys = shares[drawn < BLACK * dot.level]
        return cls(alone, by_blur, float(beyond @ beyond), float(beyond @ left), float(np.mean(shares**2)), greys)

    def step(self, blur_step: float) -> FloatArray:
        """Of radius, column, row and level, with that change of the blur."""
        return np.asarray(self.alone + blur_step * self.by_blur, dtype=np.float64)
