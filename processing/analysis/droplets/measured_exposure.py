"""What the measurement of an exposure comes to, bright particles or shadows: droplets, and whether to believe them."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from enum import StrEnum
from typing import TYPE_CHECKING, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from processing.analysis.droplets.droplet_search import DropletSearch
from processing.analysis.droplets.droplet_table import DropletRows
from processing.analysis.droplets.gaussian_blobs import Image
from processing.analysis.droplets.ghost_share import (
    BESIDE_LIQUID,
    MANY_OBJECTS,
    UNTRIED,
    GhostShare,
    matches,
    told_share,
)
from processing.analysis.estimates import Estimate
from processing.analysis.hidden import Hidden
from processing.geometry import FloatArray

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

MOST_SHIFT_PX = 0.3
"""Views that lie farther beside their calibration are refused."""
MANY_GHOSTS = 0.1
"""Share in a twin from which on a shot is doubtful: ghosts can explain images as well as the truth does."""
MOST_HIDDEN = 0.5
"""Share of the volume that may be hidden."""
EVEN, MOSTLY = 1.05, 0.9
"""Where more than so many times the noise is left, so large a share of what views see must be explained by droplets."""
LIT_SIGMAS, LIT_PIXELS = 6.0, 4
"""A view that has fewer pixels above so many standard deviations of its noise sees nothing."""
TWIN_MOVE_VOXEL = 15.0
"""So far at most droplets of a twin are moved along every axis: chance alignments are new, density stays."""
Rows = TypeVar("Rows", bound=DropletRows, covariant=True)
Seen = TypeVar("Seen", bound="DataclassInstance", covariant=True)


class ShotVerdict(StrEnum):
    """What droplets of an exposure are good for."""

    GOOD = "good"
    EMPTY = "empty"
    DOUBTFUL = "doubtful"
    REFUSED = "refused"


NOTHING_HIDDEN = Hidden()


@dataclass(frozen=True, eq=False)
class MeasuredExposure(Generic[Rows, Seen]):
    """One exposure.

    Parameters
    ----------
    droplets : Droplets | SizedDroplets
        Those within the grid; none where the exposure is refused.
    views : dict of name to SeenView | SeenShadows
        What each view looks like; empty where nothing was fitted.
    residual_over_noise : float | None
        Root mean square of what the droplets do not explain, over the noise; None where nothing was fitted.
    verdict : ShotVerdict
        What it is good for.
    reasons : tuple of str
        Why it is no better, and what to do.
    twins : GhostShare | None
        Ghosts of its twins, a witness; None where none were asked for, or where they would not tell.
    hidden : Hidden
        What could not be measured.
    """

    droplets: Rows
    views: dict[str, Seen]
    residual_over_noise: float | None
    verdict: ShotVerdict
    reasons: tuple[str, ...] = ()
    twins: GhostShare | None = None
    hidden: Hidden = NOTHING_HIDDEN

    @property
    def ghost_share(self) -> Estimate | str:
        """Which share of the droplets are ghosts, or why that is not told."""
        if self.verdict in (ShotVerdict.DOUBTFUL, ShotVerdict.REFUSED):
            return "; ".join(self.reasons)
        return told_share(self.droplets.p_real, self.droplets.sized, untried=self.untried)

    @property
    def beside_liquid(self) -> bool:
        """Whether there is more liquid that is no droplet than what ghosts were tried beside."""
        return self.hidden.liquid_objects > MANY_OBJECTS * len(self.droplets)

    @property
    def untried(self) -> str:
        """Why it may not be told how probably droplets are real."""
        return BESIDE_LIQUID if self.beside_liquid else UNTRIED

    def told(self) -> dict[str, object]:
        """What files say of it, beside the droplets."""
        return {
            "verdict": self.verdict.value,
            "reasons": self.reasons,
            "residual_over_noise": self.residual_over_noise,
            "views": {name: asdict(view) for name, view in self.views.items()},
            "twins": asdict(self.twins) if self.twins else None,
            "hidden": asdict(self.hidden),
        }


def check_images(images: Sequence[Image], search: DropletSearch) -> None:
    """Refuse images that do not fit their views.

    Raises
    ------
    ValueError
        Their number or shape is another, or a pixel is not finite.
    """
    if len(images) != len(search.names):
        raise ValueError(f"{len(images)} images for {len(search.names)} views")
    for name, image, view in zip(search.names, images, search.plan.views, strict=True):
        if np.shape(image) != view.image_size_px[::-1]:
            raise ValueError(f"{name}: its image has shape {np.shape(image)}, its view {view.image_size_px[::-1]}")
        if not np.isfinite(image).all():
            row, column = np.argwhere(~np.isfinite(image))[0]
            raise ValueError(f"{name}: pixel (column {column}, row {row}) is {image[row, column]}")


def blind_views(bright: Sequence[Image], noises: FloatArray, names: Sequence[str]) -> tuple[str, ...]:
    """Names of the views that see nothing, from images in which droplets are bright."""
    return tuple(
        name
        for name, image, noise in zip(names, bright, noises, strict=True)
        if np.count_nonzero(image > np.median(image) + LIT_SIGMAS * noise) < LIT_PIXELS
    )


def blind_verdict(
    bright: Sequence[Image], noises: FloatArray, names: Sequence[str]
) -> tuple[ShotVerdict, tuple[str, ...]] | None:
    """Verdict and reasons where some views see nothing, or all, from images in which droplets are bright; else None."""
    blind = blind_views(bright, noises, names)
    if not blind:
        return None
    if len(blind) == len(names):
        return _without_droplets([-image for image in bright], noises, names)
    reason = (
        f"{', '.join(blind)} sees nothing while the others see droplets: is a lens covered, or a light off? "
        "Measure without the view, by a calibration that has only the others"
    )
    return ShotVerdict.REFUSED, (reason,)


def _without_droplets(
    dark: Sequence[Image], noises: FloatArray, names: Sequence[str]
) -> tuple[ShotVerdict, tuple[str, ...]]:
    """Nothing is as droplets are; if all views see spots in images that are turned over, something was mistaken."""
    if blind_views(dark, noises, names):
        return ShotVerdict.EMPTY, ("no view sees a droplet",)
    reason = (
        "all views see spots, and none is as droplets are: is the polarity another (shadow, bright), or are there "
        "droplets in the dark image or the background?"
    )
    return ShotVerdict.REFUSED, (reason,)


@dataclass(frozen=True)
class RatioLimits:
    """Of residual over noise.

    Parameters
    ----------
    trusted : float
        Ghosts are not told from droplets from here on.
    refused : float
        Nothing is believed from here on.
    """

    trusted: float
    refused: float


def judged(
    beside_px: Mapping[str, float], ratio: float, bare: float, limits: RatioLimits
) -> tuple[ShotVerdict, tuple[str, ...]]:
    """Verdict and reasons, by residual over noise and by how far views lie beside their calibration.

    Where droplets do not explain the images, how far these lie beside is no more than a guess, and not told.

    Parameters
    ----------
    beside_px : dict of name to float
        How far views lie beside their calibration.
    ratio, bare : float
        Residual over noise, with all droplets and without any.
    limits : RatioLimits
        Of the ratio.
    """
    if reasons := _refusals(beside_px, ratio, limits.refused):
        return ShotVerdict.REFUSED, reasons
    if reason := _doubt(ratio, bare, limits.trusted):
        return ShotVerdict.DOUBTFUL, (reason,)
    return ShotVerdict.GOOD, ()


def _refusals(beside_px: Mapping[str, float], ratio: float, limit: float) -> tuple[str, ...]:
    if ratio >= limit:
        return (
            f"droplets explain the images to {ratio:.2f} times the noise only, limit {limit}: do calibration and views "
            "belong together (tomoshadow check), is the spray too dense, or are droplets seen outside of what was "
            "searched?",
        )
    return tuple(
        f"{name} lies {shift_px:.2f} px beside its calibration, limit {MOST_SHIFT_PX} px: correct it by the droplets "
        "(tomoshadow self-calibrate) or calibrate again"
        for name, shift_px in beside_px.items()
        if shift_px > MOST_SHIFT_PX
    )


def _doubt(ratio: float, bare: float, limit: float) -> str:
    """Why what droplets leave unexplained casts doubt on them; empty where it does not."""
    if ratio >= limit:
        return (
            f"droplets explain the images to {ratio:.2f} times the noise, more than {limit}: how many are ghosts "
            "cannot be told"
        )
    if ratio < EVEN or (share := (bare**2 - ratio**2) / (bare**2 - 1)) >= MOSTLY:
        return ""
    return (
        f"droplets explain {100 * max(0.0, share):.0f} % of what views see beyond their noise, limit "
        f"{100 * MOSTLY:.0f} %: the rest is too small or too faint to be told as droplets, and missing in number "
        "density and mean sizes"
    )


def judged_by_volume(shot: "MeasuredExposure[Rows, Seen]") -> "MeasuredExposure[Rows, Seen]":
    """A shot, doubtful where most of its volume could not be measured."""
    if shot.hidden.volume_share <= MOST_HIDDEN:
        return shot
    share = f"{100 * shot.hidden.volume_share:.0f} % of the volume, limit {100 * MOST_HIDDEN:.0f} %"
    reason = (
        f"liquid that is no droplet hides {share}: measure farther from the nozzle (--grid)"
        if shot.hidden.liquid_objects
        else f"too few views see {share}: take a box that all of them see (--grid)"
    )
    return replace(shot, verdict=ShotVerdict.DOUBTFUL, reasons=(*shot.reasons, reason))


def judged_by_twins(shot: "MeasuredExposure[Rows, Seen]", ghosts: GhostShare) -> "MeasuredExposure[Rows, Seen]":
    """A shot with the ghosts of its twins; doubtful where they are many, however well droplets explain the images."""
    if ghosts.share is None or ghosts.share <= MANY_GHOSTS:
        return replace(shot, twins=ghosts)
    reason = (
        f"of the droplets of a twin {100 * ghosts.share:.0f} % are ghosts, limit {100 * MANY_GHOSTS:.0f} %: too many "
        "droplets for so few views"
    )
    return replace(shot, twins=ghosts, verdict=ShotVerdict.DOUBTFUL, reasons=(*shot.reasons, reason))


def told_real(shot: "MeasuredExposure[Rows, Seen]") -> "MeasuredExposure[Rows, Seen]":
    """A shot that tells how probably droplets are real, or does not: only in good ones of droplets that was tried."""
    tried = shot.verdict is ShotVerdict.GOOD and not shot.beside_liquid
    return shot if tried else replace(shot, droplets=shot.droplets.unsure())


def within_grid(positions_voxel: FloatArray, search: DropletSearch) -> NDArray[np.bool_]:
    """Which positions (N, 3), in voxels of what is searched, are within the grid of a search."""
    low, high = _box(search)
    return np.asarray(np.all((positions_voxel >= low) & (positions_voxel < high), axis=1))


def ghosts_within(found_voxel: FloatArray, truth_voxel: FloatArray, search: DropletSearch) -> GhostShare:
    """Ghosts among the found droplets (N, 3) within the grid of a search, in voxels of what is searched."""
    inside = within_grid(found_voxel, search)
    ghost = matches(found_voxel, truth_voxel)[0] < 0
    return GhostShare(int(np.count_nonzero(ghost & inside)), int(np.count_nonzero(inside)))


def moved(positions_voxel: FloatArray, search: DropletSearch, rng: np.random.Generator) -> FloatArray:
    """Positions of a twin: moved at random; what was within the grid, or in its margin, is reflected back into it."""
    low, high = _box(search)
    inside = within_grid(positions_voxel, search)[:, None]
    least = np.where(inside, low, 0.0)
    most = np.where(inside, high, np.array(search.searched.shape[::-1]) - 1.0)
    there = positions_voxel + rng.uniform(-TWIN_MOVE_VOXEL, TWIN_MOVE_VOXEL, positions_voxel.shape)
    above = least + np.abs(there - least)
    back: FloatArray = np.clip(most - np.abs(most - above), least, most)
    return back


def _box(search: DropletSearch) -> tuple[FloatArray, FloatArray]:
    """Lower and upper end of the grid, in voxels of what is searched."""
    margin = (np.array(search.searched.shape[::-1]) - np.array(search.grid.shape[::-1])) / 2
    return margin - 0.5, margin + np.array(search.grid.shape[::-1]) - 0.5
