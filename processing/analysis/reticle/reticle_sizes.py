"""Diameters that the product finds for the dots of a reticle, and those that they have."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from processing.analysis.droplets.gaussian_blobs import Image
from processing.analysis.droplets.shadows.discs.disc_optics import first_disc_optics
from processing.analysis.droplets.shadows.discs.disc_profiles import disc_profiles
from processing.analysis.droplets.shadows.light.light_search import Light, Relit, seen_light, stated_ratio
from processing.analysis.droplets.shadows.light.seen_light import LEAST_DROPLETS, SeenLight, light_doubts
from processing.analysis.droplets.shadows.shadow_light import BLACK_PIXELS, MOST_LEFT
from processing.analysis.reticle.dot_fit import Dot, FittedDots, fit_dots
from processing.analysis.reticle.dots_in_space import PlaneDots, SeenDots, dots_on_plane, ellipses, seen_dots
from processing.analysis.reticle.size_groups import IN_ANY_LIGHT, IN_ITS_LIGHT, ReticleError, size_groups
from processing.calibration.droplets.droplet_matching import Box
from processing.geometry import FloatArray, ViewMapping


@dataclass(frozen=True, eq=False)
class DotGroup:
    """Dots of one diameter.

    Parameters
    ----------
    true_um, found_um : float
        As the maker states it; median of the dots, each the mean of its views.
    sd_um : float
        Standard deviation of ``found_um``: of the dots over the root of their number, and of the views likewise.
    dots : int
        How many.
    views_um : tuple of float
        Median of the dots in each view.
    """

    true_um: float
    found_um: float
    sd_um: float
    dots: int
    views_um: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class ReticleSizes:
    """What a reticle says.

    Parameters
    ----------
    groups : tuple of DotGroup
        By diameter.
    condenser_ratio : float | None
        Numerical aperture of the light over that of the lens; None: blur is Gaussian.
    light_share : float
        Of the dots, which this light explains better than a Gaussian blur does.
    blurs_px : tuple of float
        Of each view.
    residual : float
        Root mean square of what is left around the dots, relative to the light.
    middle_mm, normal : (3,) arrays
        Of the plane of the dots.
    """

    groups: tuple[DotGroup, ...]
    condenser_ratio: float | None
    light_share: float
    blurs_px: tuple[float, ...]
    residual: float
    middle_mm: FloatArray
    normal: FloatArray


def measure_reticle(
    images: Sequence[Image],
    mappings: Sequence[ViewMapping],
    box: Box,
    diameters_um: Sequence[float],
    *,
    trust: Sequence[Image] | None = None,
    light: Light = "estimated",
) -> ReticleSizes:
    """Measure the dots of a reticle that all views see.

    Parameters
    ----------
    images : sequence of (rows, columns) float32 arrays
        Transmissions, one per view: light over that of the background, mean of many exposures.
    mappings : sequence of ViewMapping
        Of the same views.
    box : Box
        Where the reticle may be.
    diameters_um : sequence of float
        Of its dots, increasing: all that are seen three times or more.
    trust : sequence of (rows, columns) float32 arrays, optional
        How sure pixels are, 0 where nothing is known; by default all are known.
    light : float | "estimated" | "incoherent" | "gaussian"
        Numerical aperture of the light over that of the lens.

    Raises
    ------
    ReticleError
        The images show something else; the text says what.
    """
    known = [np.ones(image.shape, bool) if trust is None else trust[k] > 0 for k, image in enumerate(images)]
    seen = [seen_dots(*view) for view in zip(images, known, strict=True)]
    reticle = _Reticle(images, mappings, seen, dots_on_plane(mappings, seen, box))
    seen_in = reticle.light() if light == "estimated" else SeenLight(stated_ratio(light), 1.0)
    views = reticle.fitted(seen_in.condenser_ratio)
    _require_black(np.concatenate([view.greys for view in views]))
    found_um = reticle.diameters_um(views)
    unknown = light == "gaussian" or light_doubts(seen_in.share, len(found_um))
    numbers = size_groups(found_um.mean(axis=1), diameters_um, IN_ANY_LIGHT if unknown else IN_ITS_LIGHT)
    groups = tuple(
        _group(true_um, found_um[numbers == number]) for number, true_um in enumerate(map(float, diameters_um))
    )
    squares = np.stack([view.squares for view in views])[:, numbers >= 0]
    return ReticleSizes(
        groups,
        seen_in.condenser_ratio,
        seen_in.share,
        tuple(view.blur_px for view in views),
        float(np.sqrt(squares.mean())),
        reticle.dots.points_mm.mean(axis=0),
        reticle.dots.normal,
    )


def _require_black(greys: FloatArray) -> None:
    if len(greys) >= BLACK_PIXELS and (share := float(np.median(greys))) > MOST_LEFT:
        raise ReticleError(
            f"{100 * share:.0f} % of the light is left where dots should be black, limit {100 * MOST_LEFT:.0f} %: is a "
            "dark image missing (the camera's black level), are grey values not in proportion to light (gamma), are "
            "the dots not opaque, or is the light that was stated another one? Diameters are wrong then"
        )


def _group(true_um: float, found_um: FloatArray) -> DotGroup:
    """By the diameters (dots, views)."""
    dots_um, views_um = found_um.mean(axis=1), np.median(found_um, axis=0)
    of_dots = dots_um.std(ddof=1) / np.sqrt(len(dots_um))
    of_views = views_um.std(ddof=1) / np.sqrt(len(views_um))
    return DotGroup(
        true_um,
        float(np.median(dots_um)),
        float(np.hypot(of_dots, of_views)),
        len(dots_um),
        tuple(views_um.tolist()),
    )


@dataclass(frozen=True, eq=False)
class _Reticle:
    """Images, views and dots of a reticle."""

    images: Sequence[Image]
    mappings: Sequence[ViewMapping]
    seen: Sequence[SeenDots]
    dots: PlaneDots

    def light(self) -> SeenLight:
        """The light that most dots say."""
        if len(self.dots.points_mm) < LEAST_DROPLETS:
            raise ReticleError(
                f"{len(self.dots.points_mm)} dots do not tell the light, {LEAST_DROPLETS} would; state it "
                "(--light: aperture of the light over that of the lens, incoherent or gaussian)"
            )

        def in_light(condenser_ratio: float | None) -> Relit:
            views = self.fitted(condenser_ratio)
            return Relit(np.sum([view.squares for view in views], axis=0), self.diameters_um(views).mean(axis=1) / 2)

        return seen_light(in_light)

    def fitted(self, condenser_ratio: float | None) -> list[FittedDots]:
        """Dots of all views in a light."""
        profiles = disc_profiles(condenser_ratio)
        blurs_px = np.sqrt(first_disc_optics(self.images).variances_px2[:, 0])
        return [
            fit_dots(image, self._begun(view), blur_px, profiles)
            for view, (image, blur_px) in enumerate(zip(self.images, blurs_px.tolist(), strict=True))
        ]

    def diameters_um(self, views: Sequence[FittedDots]) -> NDArray[np.float64]:
        """Diameters (dots, views)."""
        columns = [
            2000 * np.array([dot.ellipse.major_px for dot in view.dots]) / self._majors_px_per_mm(mapping)
            for view, mapping in zip(views, self.mappings, strict=True)
        ]
        return np.column_stack(columns)

    def _majors_px_per_mm(self, mapping: ViewMapping) -> FloatArray:
        return np.array([one.major_px for one in ellipses(self.dots, mapping, np.ones(len(self.dots.points_mm)))])

    def _begun(self, view: int) -> list[Dot]:
        chosen, mapping = self.dots.numbers[:, view], self.mappings[view]
        areas = np.abs(np.linalg.det(self.dots.circles_px_per_mm(mapping)))
        outlines = ellipses(self.dots, mapping, self.seen[view].radii_px[chosen] / np.sqrt(areas))
        return [
            Dot(outline, middle) for outline, middle in zip(outlines, self.seen[view].middles_px[chosen], strict=True)
        ]
