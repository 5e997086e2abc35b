"""Shadows of one exposure, measured: droplets with their sizes, what the views look like, and whether to believe it."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from processing.analysis.droplets.droplet_search import DropletSearch, keep_on
from processing.analysis.droplets.droplet_table import SizedDroplets
from processing.analysis.droplets.gaussian_blobs import Image
from processing.analysis.droplets.ghost_share import GhostShare, found_by_class, matches, pooled
from processing.analysis.droplets.measured_exposure import MeasuredExposure, ShotVerdict, told_real
from processing.analysis.droplets.reality import twins_of
from processing.analysis.droplets.shadows.discs.opaque_discs import DiscImages, Discs
from processing.analysis.droplets.shadows.judged_volume import (
    beside_what_is_not_known,
    is_judged,
    judging_views,
    knowing_views,
)
from processing.analysis.droplets.shadows.light.light_search import Light
from processing.analysis.droplets.shadows.light.seen_light import SeenLight
from processing.analysis.droplets.shadows.masked_liquid import liquid_objects, lumps
from processing.analysis.droplets.shadows.proportion import proportion_doubts
from processing.analysis.droplets.shadows.seen_shadows import SeenShadows, seen_shadows
from processing.analysis.droplets.shadows.shadow_finder import (
    behind_gaussian_blur,
    find_shadows,
    light_contradicted,
    nobody_knows,
)
from processing.analysis.droplets.shadows.shadow_fit import ShadowFit, Transmissions, rms_over_noise, seen_by
from processing.analysis.droplets.shadows.shadow_light import covered_share, judged_by_light, judged_by_shape, unlit
from processing.analysis.droplets.shadows.shadow_table import sized_droplets
from processing.analysis.droplets.shadows.shadow_union import union_defects
from processing.analysis.droplets.size_correction import SizeCorrection
from processing.analysis.droplets.verdicts.blind_views import blind_verdict, check_images
from processing.analysis.droplets.verdicts.companions import judged_by_overlap
from processing.analysis.droplets.verdicts.cut_sizes import judged_by_smallest
from processing.analysis.droplets.verdicts.doubled import judged_by_copies
from processing.analysis.droplets.verdicts.elongation import judged_by_length
from processing.analysis.droplets.verdicts.hidden_volume import judged_by_volume
from processing.analysis.droplets.verdicts.improbable import judged_by_probability
from processing.analysis.droplets.verdicts.twins import ghosts_within, judged_by_twins, moved
from processing.analysis.droplets.verdicts.unexplained_shadows import judged_by_unexplained, unexplained_shadows
from processing.analysis.hidden import Hidden
from processing.kernels import DEFAULT_THREADS
from processing.preprocessing import without_mosaic

ShadowExposure = MeasuredExposure[SizedDroplets, SeenShadows]


def measure_shadows(
    images: Sequence[Image],
    search: DropletSearch,
    *,
    trust: Sequence[Image] | None = None,
    light: Light = "estimated",
    sizes: SizeCorrection | None = None,
    twins: int = 0,
    seed: int = 0,
    threads: int = DEFAULT_THREADS,
    before_round: Callable[[], None] = keep_on,
    known_light: Callable[[], SeenLight | None] = nobody_knows,
) -> ShadowExposure:
    """Measure the droplets of one exposure of shadows.

    Parameters
    ----------
    images : sequence of (rows, columns) float32 arrays
        Transmissions, one per view: light over that of the background, 1 where nothing is in its way; not clipped.
    search : DropletSearch
        Where to look.
    trust : sequence of (rows, columns) float32 arrays, optional
        How sure pixels are: inverse variances, 1 for a typical one, 0 where nothing is known; by default all alike.
    light : float | "estimated" | "incoherent" | "gaussian"
        Numerical aperture of the light over that of the lens: the smaller, the larger droplets look.
    sizes : SizeCorrection, optional
        What a reticle of dots says, in the same light.
    twins : int
        Simulated twins of the exposure in which ghosts are counted: each costs as much as the exposure itself. Where
        views are not four, and apart, there is one at least.
    seed : int
        Of the twins.
    threads : int
        The result does not depend on it.
    before_round : callable
        Called before each round of the search; what it raises ends it.
    known_light : callable
        Asked for an estimated light where droplets are too few to vote.

    Raises
    ------
    ValueError
        Number or shape of images do not fit the views, an image is too small, or a pixel is not finite.
    """
    check_images(images, search)
    trusts = [np.ones(np.shape(image), np.float32) for image in images] if trust is None else trust
    check_images(trusts, search)
    images = [without_mosaic(image, trust > 0) for image, trust in zip(images, trusts, strict=True)]
    if reasons := unmeasurable(images, trusts, search):
        return _refused(*reasons)
    shot = looking(images, trusts, search, threads)
    known_shadows = [(1 - image) * np.sqrt(one) for image, one in zip(shot.images, shot.trust, strict=True)]
    if blind := blind_verdict(known_shadows, shot.noises_of(shot.images), search.names):
        return MeasuredExposure(SizedDroplets.none(), {}, None, *blind)
    fit = find_shadows(shot, search, light, before_round, known_light)
    told = judged_by_copies(judged_by_shape(_told(shot, fit, search, sizes)), search.grid)
    told = judged_by_probability(judged_by_volume(told))
    if told.verdict is ShotVerdict.GOOD:
        told = told.doubted(light_contradicted(shot, search, fit, light, before_round))
    if told.verdict is ShotVerdict.GOOD:
        told = told.doubted(proportion_doubts(shot, search, fit))
    told = told_real(told)
    count = twins_of(twins, len(images), search.lattice.directions, len(told.droplets))
    if not count or told.verdict is not ShotVerdict.GOOD:
        return told
    rng = np.random.default_rng(seed)
    ghosts = pooled(_twin_ghosts(shot, fit, search, sizes, rng, before_round) for _ in range(count))
    return told_real(judged_by_twins(told, ghosts))


def _refused(*reasons: str) -> ShadowExposure:
    return MeasuredExposure(SizedDroplets.none(), {}, None, ShotVerdict.REFUSED, reasons)


def unmeasurable(images: Sequence[Image], trusts: Sequence[Image], search: DropletSearch) -> tuple[str, ...]:
    """Why views can show no shadows of the grid, whether there are droplets or not; empty where all can."""
    if reasons := unlit(images, trusts, search.names):
        return reasons
    unseen = _unseen(trusts, search.pixels_into_grid(), search.names)
    return (unseen,) if unseen else ()


def _told(shot: Transmissions, fit: ShadowFit, search: DropletSearch, sizes: SizeCorrection | None) -> ShadowExposure:
    """What a fit tells, and whether to believe it."""
    shadows, into_grid = _recorded(shot).drawn(fit.optics, fit.discs), shot.cut(search.pixels_into_grid())
    seen = seen_by(shot, fit, shadows.transmissions)
    asked = replace(seen, weights=tuple(map(np.multiply, seen.weights, into_grid)))
    ratio = rms_over_noise(asked, shadows.transmissions)
    views = seen_shadows(shot, fit, search, into_grid)
    verdict, reasons = judged_by_light(shot, fit, search, asked, shadows, ratio)
    if verdict is ShotVerdict.REFUSED:
        return MeasuredExposure(SizedDroplets.none(), views, ratio, verdict, reasons)
    knowing = knowing_views(shot, fit, fit.discs.positions_voxel)
    known = knowing >= judging_views(len(shot.images))
    inside = known & search.holds(fit.discs.positions_voxel)
    few = beside_what_is_not_known(knowing[inside], len(shot.images), ratio, covered_share(asked, shadows))
    if verdict is ShotVerdict.GOOD and few:
        verdict, reasons = ShotVerdict.DOUBTFUL, few
    raw = behind_gaussian_blur(shot, search, fit)[known]
    droplets = sized_droplets(shot, seen, shadows, fit.where(known), raw, search, sizes)
    lump = lumps(fit.where(known).discs, droplets.residual)
    told = droplets.where(lump < 0).within(search.grid)
    hidden = _hidden(shot, fit, search, known, lump)
    exposure = MeasuredExposure(told, views, ratio, verdict, reasons, hidden=hidden)
    exposure = judged_by_overlap(judged_by_length(exposure, [view.elongation for view in views.values()]))
    exposure = judged_by_unexplained(exposure, unexplained_shadows(asked.images, shadows.transmissions, asked.weights))
    return judged_by_smallest(exposure, [view.complete_from_um for view in views.values()])


def _hidden(
    shot: Transmissions, fit: ShadowFit, search: DropletSearch, known: NDArray[np.bool_], lump: NDArray[np.intp]
) -> Hidden:
    """What could not be measured: beside objects of liquid, lumps of known discs, and where too few views know."""
    return Hidden.of(
        search.grid.shape,
        lambda shares: is_judged(shot, fit, search.places_at(shares)),
        liquid_objects=_counted(liquid_objects(fit.liquid)) + _counted(lump),
        droplets=int(np.count_nonzero(search.holds(fit.discs.positions_voxel[~known]))),
    )


def _unseen(trusts: Sequence[Image], into_grid: Sequence[NDArray[np.bool_]], names: Sequence[str]) -> str:
    """Why nothing could be judged; empty where all views look into the grid."""
    views = zip(names, trusts, into_grid, strict=True)
    unseen = [name for name, trust, chosen in views if not np.any(trust[chosen] > 0)]
    if not unseen:
        return ""
    return f"{', '.join(unseen)}: no pixel that is known looks into the grid: is it outside of the images, or too thin?"


def looking(images: Sequence[Image], trusts: Sequence[Image], search: DropletSearch, threads: int) -> Transmissions:
    """Transmissions of pixels that look into what is searched; of others nothing is known, and no shadow is there."""
    chosen, windows = search.pixels_into_search(), search.windows()
    known = zip(images, trusts, chosen, windows, strict=True)
    seen = [(np.where(some, image, 1)[at], np.where(some, trust, 0)[at]) for image, trust, some, at in known]
    origins_px = np.array([(columns.start, rows.start) for rows, columns in windows], dtype=np.float64)
    return Transmissions(
        tuple(image.astype(np.float32) for image, _ in seen),
        tuple(trust.astype(np.float32) for _, trust in seen),
        search.lattice.within(origins_px),
        threads,
        windows,
    )


def _recorded(shot: Transmissions) -> DiscImages:
    return DiscImages(shot.images, shot.trust, shot.lattice, shot.threads)


def _counted(numbers: NDArray[np.intp]) -> int:
    """How many objects are numbered, from 0."""
    return int(numbers.max(initial=-1)) + 1


def _twin_ghosts(
    shot: Transmissions,
    fit: ShadowFit,
    search: DropletSearch,
    sizes: SizeCorrection | None,
    rng: np.random.Generator,
    before_round: Callable[[], None],
) -> GhostShare:
    """Ghosts of a twin, and what is missed: the droplets moved, united, made noisy, and found again."""
    recorded, truth = _recorded(shot), Discs(moved(fit.discs.positions_voxel, search, rng), fit.discs.squares_voxel2)
    defects = union_defects(recorded, fit.optics, truth)
    drawn = recorded.drawn(fit.optics, truth).transmissions
    images = tuple(
        (np.float32(level) * (image + defect) + rng.normal(0, noise, image.shape)).astype(np.float32)
        for image, defect, level, noise in zip(drawn, defects, fit.optics.levels, fit.noises, strict=True)
    )
    trust = replace(shot, trust=tuple(map(np.ones_like, images))).masked(fit.masks).trust
    light: Light = fit.optics.condenser_ratio or "gaussian"
    found = find_shadows(replace(shot, images=images, trust=trust), search, light, before_round).discs
    ghosts = ghosts_within(found.positions_voxel, truth.positions_voxel, search)
    could = search.holds(truth.positions_voxel) & is_judged(shot, fit, truth.positions_voxel)
    is_found = matches(found.positions_voxel, truth.positions_voxel)[1] >= 0
    diameters_um = 2000 * truth.radii_voxel * search.searched.pitch_mm
    told_um = diameters_um if sizes is None else sizes.corrected(diameters_um)
    return replace(ghosts, classes=found_by_class(told_um[could], is_found[could]))
