"""Bright particles of one exposure, measured: droplets, what the views look like, and whether to believe it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from processing.analysis.droplets.bright_finder import MODEL_SHARE, BrightFit, find_bright, rms, rms_of
from processing.analysis.droplets.droplet_search import DropletSearch
from processing.analysis.droplets.droplet_table import Droplets
from processing.analysis.droplets.gaussian_blobs import BlobImages, BlobOptics, Blobs, Image
from processing.analysis.droplets.ghost_share import GhostShare, matches
from processing.analysis.droplets.image_noise import noise_of
from processing.geometry import FloatArray
from processing.kernels import DEFAULT_THREADS, _native

MOST_SHIFT_PX = 0.3
"""Views that lie farther beside their calibration are refused."""
TRUSTED_RATIO, REFUSED_RATIO = 1.05, 1.5
"""Of residual over noise: ghosts are not told from droplets from the first on, nothing is believed from the second."""
MANY_GHOSTS = 0.1
"""Share in a twin from which on a shot is doubtful: ghosts can explain images as well as the truth does."""
LIT_SIGMAS, LIT_PIXELS = 6.0, 4
"""A view that has fewer pixels above so many standard deviations of its noise sees nothing."""
TWIN_MOVE_VOXEL = 15.0
"""So far at most droplets of a twin are moved along every axis: chance alignments are new, density stays."""


class ShotVerdict(StrEnum):
    """What droplets of an exposure are good for."""

    GOOD = "good"
    EMPTY = "empty"
    DOUBTFUL = "doubtful"
    REFUSED = "refused"


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
    """

    noise: float
    offset: float
    gain: float
    sigma_u_px: float
    sigma_v_px: float
    shift_u_px: float
    shift_v_px: float


@dataclass(frozen=True, eq=False)
class BrightShot:
    """One exposure.

    Parameters
    ----------
    droplets : Droplets
        Those within the grid; none where the exposure is refused.
    views : dict of name to SeenView
        Empty where nothing was fitted.
    residual_over_noise : float | None
        Root mean square of what the droplets do not explain, over the noise; None where nothing was fitted.
    verdict : ShotVerdict
        What it is good for.
    reasons : tuple of str
        Why it is no better, and what to do.
    ghosts : GhostShare | None
        From twins; None where none were asked for, or where they would not tell.
    """

    droplets: Droplets
    views: dict[str, SeenView]
    residual_over_noise: float | None
    verdict: ShotVerdict
    reasons: tuple[str, ...] = ()
    ghosts: GhostShare | None = None


def measure_bright(
    images: Sequence[Image], search: DropletSearch, *, twins: int = 0, seed: int = 0, threads: int = DEFAULT_THREADS
) -> BrightShot:
    """Measure the bright particles of one exposure.

    Parameters
    ----------
    images : sequence of (rows, columns) float32 arrays
        One per view, bright particles on black, of any unit; not clipped at black, or noise cannot be judged.
    search : DropletSearch
        Where to look.
    twins : int
        Simulated twins of the exposure in which ghosts are counted: each costs as much as the exposure itself.
    seed : int
        Of the twins.
    threads : int
        The result does not depend on it.

    Raises
    ------
    ValueError
        Number or shape of images do not fit the views, an image is too small, or a pixel is not finite.
    """
    _check(images, search)
    noises = np.array([noise_of(image) for image in images])
    blind = _blind(images, noises, search.names)
    if blind:
        return _without_droplets(blind, search.names)
    shot = BlobImages(
        tuple(np.asarray(image / np.float32(noise)) for image, noise in zip(images, noises, strict=True)),
        search.lattice,
        threads,
    )
    fit = find_bright(shot, search)
    residuals = shot.residuals(fit.optics, fit.blobs)
    left = np.array([noise_of(residual) for residual in residuals])
    ratio = rms(residuals) / rms_of(np.maximum(left, MODEL_SHARE * fit.scale * fit.optics.gains))
    views = _seen(fit.optics, noises, left, search.names)
    verdict, reasons = _judged(views, ratio)
    if verdict is ShotVerdict.REFUSED:
        return BrightShot(Droplets.none(), views, ratio, verdict, reasons)
    droplets = _droplets(shot, fit, residuals, search, left, noises).within(search.grid)
    told = BrightShot(droplets, views, ratio, verdict, reasons)
    if not twins or verdict is not ShotVerdict.GOOD:
        return told
    rng = np.random.default_rng(seed)
    counted = [_twin_ghosts(shot, fit, search, left, rng) for _ in range(twins)]
    ghosts, found = (sum(counts) for counts in zip(*counted, strict=True))
    return judged_by_twins(told, GhostShare(ghosts, found))


def judged_by_twins(shot: BrightShot, ghosts: GhostShare) -> BrightShot:
    """A shot with the ghosts of its twins; doubtful where they are many, however well droplets explain the images."""
    if ghosts.share is None or ghosts.share <= MANY_GHOSTS:
        return replace(shot, ghosts=ghosts)
    reason = (
        f"of the droplets of a twin {100 * ghosts.share:.0f} % are ghosts, limit {100 * MANY_GHOSTS:.0f} %: too many "
        "droplets for so few views"
    )
    return replace(shot, ghosts=ghosts, verdict=ShotVerdict.DOUBTFUL, reasons=(*shot.reasons, reason))


def _check(images: Sequence[Image], search: DropletSearch) -> None:
    if len(images) != len(search.names):
        raise ValueError(f"{len(images)} images for {len(search.names)} views")
    for name, image, view in zip(search.names, images, search.plan.views, strict=True):
        if np.shape(image) != view.image_size_px[::-1]:
            raise ValueError(f"{name}: its image has shape {np.shape(image)}, its view {view.image_size_px[::-1]}")
        if min(image.shape) < _native.MAX_BLOB_WINDOW_PX:
            raise ValueError(f"{name}: an image of {image.shape} px, at least {_native.MAX_BLOB_WINDOW_PX} are needed")
        if not np.isfinite(image).all():
            row, column = np.argwhere(~np.isfinite(image))[0]
            raise ValueError(f"{name}: pixel (column {column}, row {row}) is {image[row, column]}")


def _blind(images: Sequence[Image], noises: FloatArray, names: Sequence[str]) -> tuple[str, ...]:
    """Names of the views that see nothing."""
    return tuple(
        name
        for name, image, noise in zip(names, images, noises, strict=True)
        if np.count_nonzero(image > np.median(image) + LIT_SIGMAS * noise) < LIT_PIXELS
    )


def _without_droplets(blind: Sequence[str], names: Sequence[str]) -> BrightShot:
    if len(blind) == len(names):
        return BrightShot(Droplets.none(), {}, None, ShotVerdict.EMPTY, ("no view sees a droplet",))
    reason = (
        f"{', '.join(blind)} sees nothing while the others see droplets: is a lens covered, or a light off? "
        "Measure without the view, by a calibration that has only the others"
    )
    return BrightShot(Droplets.none(), {}, None, ShotVerdict.REFUSED, (reason,))


def _seen(optics: BlobOptics, noises: FloatArray, left: FloatArray, names: Sequence[str]) -> dict[str, SeenView]:
    gains = optics.gains * noises
    rows = np.column_stack(
        [noises * left, optics.offsets * noises, gains / gains.mean(), optics.sigmas_px, optics.shifts_px]
    )
    return {name: SeenView(*row) for name, row in zip(names, rows.tolist(), strict=True)}


def _judged(views: dict[str, SeenView], ratio: float) -> tuple[ShotVerdict, tuple[str, ...]]:
    refused = [
        f"{name} lies {beside_px:.2f} px beside its calibration, limit {MOST_SHIFT_PX} px: correct it by the droplets "
        "(tomoshadow self-calibrate) or calibrate again"
        for name, view in views.items()
        if (beside_px := float(np.hypot(view.shift_u_px, view.shift_v_px))) > MOST_SHIFT_PX
    ]
    if ratio >= REFUSED_RATIO:
        refused.append(
            f"droplets explain the images to {ratio:.2f} times the noise only, limit {REFUSED_RATIO}: do calibration "
            "and views belong together (tomoshadow check), is the spray too dense, or are droplets seen outside "
            "of what was searched?"
        )
    if refused:
        return ShotVerdict.REFUSED, tuple(refused)
    if ratio >= TRUSTED_RATIO:
        reason = (
            f"droplets explain the images to {ratio:.2f} times the noise, more than {TRUSTED_RATIO}: how many are "
            "ghosts cannot be told"
        )
        return ShotVerdict.DOUBTFUL, (reason,)
    return ShotVerdict.GOOD, ()


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
    _, shapes, squares, pixels = np.moveaxis(shot.supports(optics, blobs, residuals), -1, 0)
    weights = (optics.gains / left)[:, None] ** 2 * shapes
    slopes = search.lattice.slopes_px(blobs.positions_voxel) / optics.sigmas_px[:, None, :, None]
    information = 0.5 * blobs.amplitudes[:, None, None] ** 2 * np.einsum("kn,knci,kncj->nij", weights, slopes, slopes)
    unit = float(np.mean(optics.gains * noises))
    whole = np.pi * optics.sigmas_px.prod(axis=1)[:, None]
    return Droplets(
        points_mm=search.searched.to_mm(blobs.positions_voxel[:, ::-1]),
        covariance_mm2=np.linalg.pinv(information, hermitian=True) * search.searched.pitch_mm**2,
        amplitudes=blobs.amplitudes * unit,
        amplitude_sd=unit / np.sqrt(weights.sum(axis=0)),
        views=np.count_nonzero(shapes > 0.5 * whole, axis=0),
        residual=np.sqrt((squares / left[:, None] ** 2).sum(axis=0) / pixels.sum(axis=0)),
    )


def _twin_ghosts(
    shot: BlobImages, fit: BrightFit, search: DropletSearch, left: FloatArray, rng: np.random.Generator
) -> tuple[int, int]:
    """Ghosts and found droplets within the grid of a twin: the droplets moved, drawn, made noisy, and found again."""
    low, high = _box(search)
    truth = Blobs(_moved(fit.blobs.positions_voxel, search, rng), fit.blobs.amplitudes)
    images = tuple(
        (image + np.float32(offset) + rng.normal(0, noise, image.shape)).astype(np.float32)
        for image, offset, noise in zip(shot.drawn(fit.optics, truth), fit.optics.offsets, left, strict=True)
    )
    found = find_bright(replace(shot, images=images), search).blobs.positions_voxel
    inside = np.all((found >= low) & (found < high), axis=1)
    ghost = matches(found, truth.positions_voxel)[0] < 0
    return int(np.count_nonzero(ghost & inside)), int(np.count_nonzero(inside))


def _box(search: DropletSearch) -> tuple[FloatArray, FloatArray]:
    """Lower and upper end of the grid, in voxels of what is searched."""
    margin = (np.array(search.searched.shape[::-1]) - np.array(search.grid.shape[::-1])) / 2
    return margin - 0.5, margin + np.array(search.grid.shape[::-1]) - 0.5


def _moved(positions_voxel: FloatArray, search: DropletSearch, rng: np.random.Generator) -> FloatArray:
    """Positions moved at random; what was within the grid, or in its margin, is reflected back into it."""
    low, high = _box(search)
    inside = np.all((positions_voxel >= low) & (positions_voxel < high), axis=1)[:, None]
    least = np.where(inside, low, 0.0)
    most = np.where(inside, high, np.array(search.searched.shape[::-1]) - 1.0)
    moved = positions_voxel + rng.uniform(-TWIN_MOVE_VOXEL, TWIN_MOVE_VOXEL, positions_voxel.shape)
    above = least + np.abs(moved - least)
    back: FloatArray = np.clip(most - np.abs(most - above), least, most)
    return back
