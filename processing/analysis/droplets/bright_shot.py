"""Bright particles of one exposure, measured: droplets, what the views look like, and whether to believe it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from processing.analysis.droplets.bright_finder import MODEL_SHARE, BrightFit, fainter, find_bright, rms, rms_of
from processing.analysis.droplets.droplet_search import DropletSearch, keep_on
from processing.analysis.droplets.droplet_table import Droplets
from processing.analysis.droplets.gaussian_blobs import BlobImages, Blobs, Image
from processing.analysis.droplets.ghost_share import GhostShare, is_told, pooled
from processing.analysis.droplets.image_noise import noise_of
from processing.analysis.droplets.measured_exposure import MeasuredExposure, ShotVerdict, told_real
from processing.analysis.droplets.reality import Evidence, Reality, crowding
from processing.analysis.droplets.verdicts.blind_views import blind_verdict, check_images
from processing.analysis.droplets.verdicts.companions import judged_by_company
from processing.analysis.droplets.verdicts.cut_sizes import judged_by_fainter, judged_by_smallest
from processing.analysis.droplets.verdicts.doubled import judged_by_copies
from processing.analysis.droplets.verdicts.explained_images import RatioLimits, judged
from processing.analysis.droplets.verdicts.hidden_volume import judged_by_volume
from processing.analysis.droplets.verdicts.improbable import judged_by_probability
from processing.analysis.droplets.verdicts.twins import ghosts_within, judged_by_twins, moved
from processing.analysis.hidden import Hidden
from processing.geometry import FloatArray
from processing.kernels import DEFAULT_THREADS

LIMITS = RatioLimits(trusted=1.05, refused=1.5)
LEAST_LIGHT = 1e-30
"""Of a droplet in a view: it divides."""
REALITY = Reality(-13.97, (1.13, 2.42, 6.86, -1.32, -15.86, -2.23, -4.24), widths_px=(0.95, 2.05), most_crowding=1.7)


@dataclass(frozen=True)
class SeenView:
    """What a view of an exposure looks like, in the unit of the images.

    Parameters
    ----------
    noise, offset : float
        Standard deviation of the noise of a pixel, and level without droplets.
    gain : float
        How bright the view sees droplets, relative to the mean of the views.
    sigma_u_px, sigma_v_px : float
        Width of droplets along columns and rows.
    shift_u_px, shift_v_px : float
        How far the image lies beside its calibration, apart from a common motion of all.
    complete_from : float
        Amplitude from which on nearly all droplets are found, the same for all views: half of it is told, where that is
        a tenth of a typical one and five standard deviations. 0: a file of an older program does not tell.
    """

    noise: float
    offset: float
    gain: float
    sigma_u_px: float
    sigma_v_px: float
    shift_u_px: float
    shift_v_px: float
    complete_from: float = 0.0


BrightExposure = MeasuredExposure[Droplets, SeenView]


def measure_bright(
    images: Sequence[Image],
    search: DropletSearch,
    *,
    twins: int = 0,
    seed: int = 0,
    threads: int = DEFAULT_THREADS,
    before_round: Callable[[], None] = keep_on,
) -> BrightExposure:
    """Measure the bright particles of one exposure.

    Parameters
    ----------
    images : sequence of (rows, columns) float32 arrays
        One per view, bright particles on black, of any unit; not clipped at black, or noise cannot be judged.
    search : DropletSearch
        Where to look.
    twins : int
        Simulated twins of the exposure in which ghosts are counted: each costs as much as the exposure itself. Where
        nothing else tells them, as ``p_real`` was not tried on such views or spots, there is one at least.
    seed : int
        Of the twins.
    threads : int
        The result does not depend on it.
    before_round : callable
        Called before each round of the search; what it raises ends it.

    Raises
    ------
    ValueError
        Number or shape of images do not fit the views, an image is too small, or a pixel is not finite.
    """
    check_images(images, search)
    noises = np.array([noise_of(image) for image in images])
    if blind := blind_verdict(images, noises, search.names):
        return MeasuredExposure(Droplets.none(), {}, None, *blind)
    shot = BlobImages(
        tuple(np.asarray(image / np.float32(noise)) for image, noise in zip(images, noises, strict=True)),
        search.lattice,
        threads,
    )
    fit = find_bright(shot, search, before_round)
    residuals = shot.residuals(fit.optics, fit.blobs)
    left = np.array([noise_of(residual) for residual in residuals])
    told = _told(shot, fit, search, residuals, left, noises)
    count = twins or int(not is_told(told.droplets.p_real))
    if not count or told.verdict is not ShotVerdict.GOOD:
        return told
    rng = np.random.default_rng(seed)
    ghosts = pooled(_twin_ghosts(shot, fit, search, left, rng, before_round) for _ in range(count))
    return told_real(judged_by_twins(told, ghosts))


def _told(
    shot: BlobImages,
    fit: BrightFit,
    search: DropletSearch,
    residuals: Sequence[Image],
    left: FloatArray,
    noises: FloatArray,
) -> BrightExposure:
    """What a fit tells, and whether to believe it."""
    unit = rms_of(np.maximum(left, MODEL_SHARE * fit.scale * fit.optics.gains))
    ratio, bare = rms(residuals) / unit, rms(shot.residuals(fit.optics, Blobs.none())) / unit
    views = _seen(fit, noises, left, search.names)
    beside_px = {name: float(np.hypot(view.shift_u_px, view.shift_v_px)) for name, view in views.items()}
    verdict, reasons = judged(beside_px, ratio, bare, LIMITS)
    if verdict is ShotVerdict.REFUSED:
        return MeasuredExposure(Droplets.none(), views, ratio, verdict, reasons)
    droplets = _droplets(shot, fit, residuals, search, left, noises).within(search.grid)
    hidden = Hidden.of(search.grid.shape, lambda shares: _is_seen(shot, search, search.places_at(shares)))
    found = MeasuredExposure(droplets, views, ratio, verdict, reasons, hidden=hidden)
    found = judged_by_company(judged_by_copies(found, search.grid), search.grid)
    found = judged_by_smallest(found, [view.complete_from for view in views.values()])
    if found.verdict is ShotVerdict.GOOD:
        fainter_voxel = fainter(shot, search, fit).positions_voxel
        found = judged_by_fainter(found, int(np.count_nonzero(search.holds(fainter_voxel))))
    return told_real(judged_by_probability(judged_by_volume(found)))


def _is_seen(shot: BlobImages, search: DropletSearch, positions_voxel: FloatArray) -> NDArray[np.bool_]:
    """Which places (N, 3) lie in the images of all views: beyond them a droplet is not found, and not missed."""
    sizes_px = np.array([image.shape[::-1] for image in shot.images])
    seen_px = search.lattice.seen_px(positions_voxel)
    return np.asarray(np.all((seen_px >= 0) & (seen_px <= sizes_px[:, None] - 1), axis=(0, 2)), np.bool_)


def _seen(fit: BrightFit, noises: FloatArray, left: FloatArray, names: Sequence[str]) -> dict[str, SeenView]:
    optics = fit.optics
    gains, levels = optics.gains * noises, np.array([np.median(level) for level in optics.levels])
    limits = np.full(len(gains), fit.complete_from * gains.mean())
    seen = [noises * left, levels * noises, gains / gains.mean(), optics.sigmas_px, optics.shifts_px, limits]
    return {name: SeenView(*row) for name, row in zip(names, np.column_stack(seen).tolist(), strict=True)}


def _droplets(
    shot: BlobImages,
    fit: BrightFit,
    residuals: Sequence[Image],
    search: DropletSearch,
    left: FloatArray,
    noises: FloatArray,
) -> Droplets:
    """Droplets with the covariance of the fit, each as if it stood alone."""
    blobs, optics = fit.blobs, fit.optics
    if not len(blobs):
        return Droplets.none()
    products, shapes, squares, pixels = np.moveaxis(shot.supports(optics, blobs, residuals), -1, 0)
    weights = (optics.gains / left)[:, None] ** 2 * shapes
    slopes = search.lattice.slopes_px(blobs.positions_voxel) / optics.sigmas_px[:, None, :, None]
    information = 0.5 * blobs.amplitudes[:, None, None] ** 2 * np.einsum("kn,knci,kncj->nij", weights, slopes, slopes)
    unit = float(np.mean(optics.gains * noises))
    whole = np.pi * optics.sigmas_px.prod(axis=1)[:, None]
    views = np.count_nonzero(shapes > 0.5 * whole, axis=0)
    residual = np.sqrt((squares / left[:, None] ** 2).sum(axis=0) / pixels.sum(axis=0))
    width_px = rms_of(optics.sigmas_px)
    evidence = Evidence(
        together=blobs.amplitudes,
        alone=blobs.amplitudes + products / np.maximum(optics.gains[:, None] * shapes, LEAST_LIGHT),
        alone_sd=1 / np.sqrt(np.maximum(weights, LEAST_LIGHT)),
        residual=residual,
        crowding=crowding(search.lattice.seen_px(blobs.positions_voxel), np.full(len(blobs), 2 * width_px**2)),
        width_px=width_px,
        directions=search.lattice.directions,
    )
    return Droplets(
        points_mm=search.searched.to_mm(blobs.positions_voxel[:, ::-1]),
        covariance_mm2=np.linalg.pinv(information, hermitian=True) * search.searched.pitch_mm**2,
        amplitudes=blobs.amplitudes * unit,
        amplitude_sd=unit / np.sqrt(weights.sum(axis=0)),
        views=views,
        residual=residual,
        p_real=REALITY.p_real(evidence, views),
    )


def _twin_ghosts(
    shot: BlobImages,
    fit: BrightFit,
    search: DropletSearch,
    left: FloatArray,
    rng: np.random.Generator,
    before_round: Callable[[], None],
) -> GhostShare:
    """Ghosts of a twin: the droplets moved, drawn, made noisy, and found again."""
    truth = Blobs(moved(fit.blobs.positions_voxel, search, rng), fit.blobs.amplitudes)
    images = tuple(
        (image + level + rng.normal(0, noise, image.shape)).astype(np.float32)
        for image, level, noise in zip(shot.drawn(fit.optics, truth), fit.optics.levels, left, strict=True)
    )
    found = find_bright(replace(shot, images=images), search, before_round).blobs
    return ghosts_within(found.positions_voxel, truth.positions_voxel, search)
