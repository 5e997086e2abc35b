"""SprayStatistics: all that the droplets of some shots say of a spray, each figure with its interval or a reason."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from processing.analysis.droplets.droplet_file import StoredDroplets
from processing.analysis.droplets.droplet_statistics import (
    DIAMETER,
    NO_VOLUME,
    DropletStatistics,
    droplet_statistics,
)
from processing.analysis.droplets.size_statistics import SizeClass, size_classes
from processing.analysis.estimates import Estimate, Figures
from processing.analysis.spray.density_map import ToldDensity, density_maps
from processing.analysis.spray.detection import NO_TWINS, ClassDetection, detection
from processing.analysis.spray.patternation import Patternation, patternation
from processing.analysis.spray.proposed_axis import ProposedAxis, proposed_axis
from processing.analysis.spray.sample_size import SampleVerdict, sample_verdict
from processing.analysis.spray.size_fits import SizeFit, size_fits
from processing.analysis.spray.spray_axis import SprayAxis
from processing.analysis.spray.spray_doubts import spray_doubts
from processing.analysis.spray.spray_extent import SprayExtent, spray_extent
from processing.analysis.spray.spray_motion import (
    MM3_PER_UM3,
    NO_AXIS,
    NO_VELOCITIES,
    SprayMotion,
    spray_motion,
)
from processing.analysis.spray.spray_sample import SpraySample, spray_sample
from processing.analysis.velocity.velocity_statistics import velocity_statistics
from processing.calibration.verdict import Unchecked
from processing.geometry import FloatArray
from processing.reconstruction.settings import FrozenValue

LIQUIDS_KG_M3 = (50.0, 30_000.0)
"""Densities: hydrogen has 71, and none is as heavy as 30 000. Another one is in another unit."""
SLICE = 0.25
"""Of the box's reach along the axis: length of the slice of a patternation."""
CORRECTIONS = (
    "densities are per volume that could be measured: what liquid hides is taken off, in maps cell by cell",
    "diameters are corrected as the files say (diameter_um; diameter_raw_um is not)",
    "not corrected: droplets that are too small or too faint to be found, and ghosts; their shares are in the studies, "
    "and where twins were made (--twins), what is found of each class is in detection",
)


@dataclass(frozen=True)
class AskedFor:
    """What the user knows of a spray, and wants to know.

    Parameters
    ----------
    axis : SprayAxis | None
        Nozzle and direction.
    at_mm : tuple of float
        Distances of patternations along the axis; none stands for the middle of the box.
    liquid_kg_m3 : float | None
        Density of the liquid, within ``LIQUIDS_KG_M3``; ValueError otherwise.
    """

    axis: SprayAxis | None = None
    at_mm: tuple[float, ...] = ()
    liquid_kg_m3: float | None = None

    def __post_init__(self) -> None:
        low, high = LIQUIDS_KG_M3
        if self.liquid_kg_m3 is not None and not low <= self.liquid_kg_m3 <= high:
            raise ValueError(f"{self.liquid_kg_m3:g} kg/m3: liquids have {low:g} to {high:g}; water has 998")


class SprayStatistics(FrozenValue):
    """A spray, as its droplets say."""

    sampling: Annotated[
        Literal["spatial"],
        Field(description="droplets in a volume at an instant, not those that pass an area: ASTM E799"),
    ] = "spatial"
    droplets: Annotated[DropletStatistics, Field(description="number, density, mean diameters and quantiles by volume")]
    unpaired_ghost_share: Annotated[
        Estimate | None, Field(description="ghosts by droplets without a partner, a witness beside that of droplets")
    ] = None
    smallest_um: Annotated[float | None, Field(description="diameter of the smallest droplet")] = None
    liquid_ppm: Annotated[Estimate | None, Field(description="volume of liquid in droplets per volume, 1e-6")] = None
    sample: Annotated[SampleVerdict | None, Field(description="is it large enough; null without diameters")] = None
    classes: Annotated[tuple[SizeClass, ...], Field(description="by number, area, volume: ISO 9276-1, R20")] = ()
    detection: Annotated[
        tuple[ClassDetection, ...] | None, Field(description="what is found of each class, by twins, and n over it")
    ] = None
    detection_reason: Annotated[str | None, Field(description="why it is null")] = None
    fits: Annotated[tuple[SizeFit, ...], Field(description="lognormal and Rosin-Rammler, the better one first")] = ()
    motion: Annotated[SprayMotion | None, Field(description="velocities and flux")] = None
    extent: Annotated[SprayExtent | None, Field(description="cone angle and penetration")] = None
    proposed_axis: Annotated[
        ProposedAxis | None, Field(description="where nobody stated nozzle and axis: by how droplets fly")
    ] = None
    patternations: Annotated[tuple[Patternation, ...], Field(description="liquid by sectors and rings")] = ()
    density_maps: Annotated[tuple[ToldDensity, ...], Field(description="number density over x and y, x and z")] = ()
    corrections: Annotated[tuple[str, ...], Field(description="what is corrected, and what is not")] = CORRECTIONS
    doubts: Annotated[
        tuple[str, ...], Field(description="why not to trust the figures: verdicts of exposures, what contradicts")
    ] = ()
    not_checked: Annotated[
        tuple[Unchecked, ...], Field(description="what no droplet tells, and what to state so that it is known")
    ] = ()
    reasons: Annotated[
        dict[str, str], Field(description="why a part is null or empty, and what to do about it, by its name")
    ] = Field(default_factory=dict)


def spray_statistics(shots: Iterable[StoredDroplets], asked: AskedFor | None = None) -> SprayStatistics:
    """All figures of a spray.

    Parameters
    ----------
    shots : iterable of StoredDroplets
        A shot each, as ``read_droplets`` gives it; of one run or several.
    asked : AskedFor | None
        Nozzle and axis, density of the liquid.

    Raises
    ------
    DropletFileError
        As of ``droplet_statistics``.
    """
    asked, shots = asked or AskedFor(), tuple(shots)
    pooled = droplet_statistics(shots)
    if not pooled.n or any(DIAMETER not in shot.columns for shot in shots):
        why = pooled.reason or "no droplet was measured"
        reasons = dict.fromkeys(("sample", "fits", "motion", "extent"), why)
        doubts = spray_doubts(shots)
        return SprayStatistics(droplets=pooled, reasons=reasons, doubts=doubts, detection_reason=why)
    sample = spray_sample(shots)
    proposed = proposed_axis(sample)
    told = _of_sample(sample, pooled, asked, None if asked.axis else proposed)
    ghosts, doubts = velocity_statistics(shots).unpaired_ghost_share, spray_doubts(shots, sample, asked.axis, proposed)
    found = detection(shots, told.classes, sample.exposures_per_shot)
    update = {"detection": found, "detection_reason": NO_TWINS if found is None else None}
    return told.model_copy(update={"doubts": doubts, "unpaired_ghost_share": ghosts, **update})


def _of_sample(
    sample: SpraySample, pooled: DropletStatistics, asked: AskedFor, proposed: ProposedAxis | None
) -> SprayStatistics:
    extent, patternations = _in_space(sample, asked)
    fits, motion = size_fits(sample), spray_motion(sample, asked.axis, asked.liquid_kg_m3)
    return SprayStatistics(
        droplets=pooled,
        smallest_um=float(sample.diameters_um.min()),
        liquid_ppm=_liquid_ppm(sample),
        sample=sample_verdict(sample, pooled),
        classes=size_classes(sample.diameters_um, sample.exposures_per_shot),
        fits=fits,
        motion=motion,
        extent=extent,
        proposed_axis=proposed,
        patternations=patternations,
        density_maps=tuple(map(ToldDensity.of, density_maps(sample))),
        corrections=(*CORRECTIONS, *_beyond_intervals(pooled)),
        not_checked=extent.not_checked if extent else (),
        reasons=_reasons(sample, proposed, bool(fits), motion is not None) | _missing(sample, asked, patternations),
    )


def _beyond_intervals(sizes: DropletStatistics) -> tuple[str, ...]:
    """What intervals of liquid, flux and fits do not hold, though those of mean diameters do."""
    if not (sizes.light_sd_um and sizes.d32_um):
        return ()
    share = sizes.light_sd_um / sizes.d32_um.value
    return (
        f"all diameters may be {sizes.light_sd_um:.2g} um wrong alike (one standard deviation), as the light is not "
        "known better: intervals of mean diameters and quantiles hold it; those of liquid and flux, which are "
        f"{300 * share:.2g} % wrong with it, of fits, of flux-weighted diameters and of differences do not",
    )


def _in_space(sample: SpraySample, asked: AskedFor) -> tuple[SprayExtent | None, tuple[Patternation, ...]]:
    axis = asked.axis
    if axis is None:
        return None, ()
    if sample.box_mm is None:
        return spray_extent(sample, axis), ()
    near_mm, far_mm = axis.reach_mm(sample.box_mm)
    places_mm = asked.at_mm or ((near_mm + far_mm) / 2,)
    slices = (patternation(sample, axis, at_mm, SLICE * (far_mm - near_mm)) for at_mm in places_mm)
    return spray_extent(sample, axis), tuple(one for one in slices if one)


def _liquid_ppm(sample: SpraySample) -> Estimate | None:
    def ppm_of(drawn: SpraySample) -> Figures:
        volumes_mm3 = drawn.totals(MM3_PER_UM3 * np.pi / 6 * drawn.cubes_um3[:, None])
        return lambda counts: _ppm(volumes_mm3(counts), drawn.measured_mm3(counts))

    (one,) = sample.estimated(ppm_of, signed=sample.has_empty_shots)
    return one and one.within(0.0, np.inf)


def _ppm(volumes_mm3: FloatArray, measured_mm3: FloatArray) -> FloatArray:
    with np.errstate(invalid="ignore"):
        return np.asarray(1e6 * volumes_mm3 / measured_mm3)


def _reasons(sample: SpraySample, proposed: ProposedAxis | None, fits: bool, motion: bool) -> dict[str, str]:
    reasons = {}
    if not fits:
        reasons["fits"] = "fewer than 20 different diameters: measure more shots"
    if not motion:
        reasons["motion"] = NO_VELOCITIES
    if proposed:
        reasons |= dict.fromkeys(("extent", "patternations"), f"{NO_AXIS}; {proposed.words}")
    if not np.isfinite(sample.volumes_mm3).all():
        reasons["liquid_ppm"] = NO_VOLUME
    return reasons


def _missing(sample: SpraySample, asked: AskedFor, patternations: Sequence[Patternation]) -> dict[str, str]:
    """Why patternations that are asked for are not there."""
    if asked.axis is None or len(patternations) >= max(len(asked.at_mm), 1):
        return {}
    told_mm = {one.at_mm for one in patternations}
    where = ", ".join(f"{at_mm:g}" for at_mm in asked.at_mm if at_mm not in told_mm)
    few = "fewer than 20 droplets in the slice across the axis, or no common box"
    if sample.box_mm is not None:
        reach = "{:.3g} to {:.3g}".format(*asked.axis.reach_mm(sample.box_mm))
        few = f"fewer than 20 droplets in the slice across the axis; the box reaches from {reach} mm"
    return {"patternations": f"{where} mm from the nozzle: {few}" if where else few}
