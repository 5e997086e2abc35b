"""Patternation: which part of the liquid goes where, by sectors and rings around the axis, at a distance of the nozzle.

What an optical or mechanical patternator measures (Tate, Spray patternation, Ind. Eng. Chem. 52, 1960). Liquid per
measured volume of each cell times the volume of the whole cell: what a box leaves out at a cell's edge, and what liquid
hides in it, counts as the rest of it. A cell of which less than half lies in the box and could be measured is not
known.

*Asymmetry* is half the sum of ``|share - 1 / n|`` over the n sectors: 0 is even, 1 - 1 / n all in one. Few droplets are
never even, so beside it stands what 95 % of even sprays stay below: every shot turned around the axis by whole
sectors, at random.
"""

from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from processing.analysis.droplets.size_statistics import garwood
from processing.analysis.estimates import CONFIDENCE, DRAWS, SEED, Estimate, Figures
from processing.analysis.spray.spray_axis import SprayAxis, cell_volumes_mm3, direction_name
from processing.analysis.spray.spray_motion import MM3_PER_UM3, axial_volumes
from processing.analysis.spray.spray_sample import SpraySample
from processing.geometry import FloatArray
from processing.reconstruction.settings import FrozenValue

SECTORS, RINGS = 8, 5
LEAST_COVERED = 0.5
"""Of a cell, for its liquid to be known."""
FEWEST = 20
"""Droplets of a patternation."""
NARROWEST_MM = 1e-6
"""Of droplets that are all on the axis."""


class Patternation(FrozenValue):
    """Liquid by sectors and rings; sector 0 begins at x, or at z where the axis is along x.

    Seen from downstream azimuths grow counterclockwise, so along an axis y 90 degrees are at -z.
    """

    at_mm: Annotated[float, Field(description="distance from the nozzle along the axis, middle")]
    thickness_mm: Annotated[float, Field(description="so long is the slice along the axis")]
    n: Annotated[int, Field(description="droplets in it, of all exposures")]
    weighting: Annotated[str, Field(description="what is shared out: liquid, or what flows along the axis")]
    ring_edges_mm: Annotated[tuple[float, ...], Field(description="distances from the axis")]
    sectors: Annotated[int, Field(description="of 360 degrees")]
    azimuths: Annotated[tuple[str, str], Field(description="which way 0 and 90 degrees lie: x, -z, or a vector")]
    liquid_ppm: Annotated[
        tuple[tuple[float | None, ...], ...],
        Field(description="volume of liquid per volume, 1e-6, ring by ring, sector by sector; null: not measured"),
    ]
    sector_shares: Annotated[
        tuple[Estimate | None, ...], Field(description="of all; empty where a cell is not known")
    ] = ()
    ring_shares: Annotated[
        tuple[Estimate | None, ...], Field(description="of all; empty where a cell is not known")
    ] = ()
    asymmetry: Annotated[float | None, Field(description="half the sum of |share - 1/n| over sectors")] = None
    asymmetry_by_chance: Annotated[
        float | None, Field(description="that 95 % of even sprays with so many droplets and shots stay below")
    ] = None
    reason: Annotated[str | None, Field(description="why something is null or empty")] = None


def patternation(
    sample: SpraySample,
    axis: SprayAxis,
    at_mm: float,
    thickness_mm: float,
    sectors: int = SECTORS,
    rings: int = RINGS,
) -> Patternation | None:
    """Share out the liquid of a slice across the axis; None where it has fewer than 20 droplets, or the box is unknown.

    Parameters
    ----------
    sample : SpraySample
        The droplets.
    axis : SprayAxis
        Of the spray.
    at_mm, thickness_mm : float
        Middle and length of the slice along the axis; what of it lies in the box is taken.
    sectors, rings : int
        Into which it is shared out; rings of equal width out to the outermost droplet.
    """
    along_mm, _, _ = axis.coordinates(sample.points_mm)
    chosen = sample.chosen(np.abs(along_mm - at_mm) < thickness_mm / 2)
    if len(chosen) < FEWEST or sample.box_mm is None:
        return None
    _, radius_mm, azimuth_deg = axis.coordinates(chosen.points_mm)
    ring_edges_mm = np.linspace(0, max(np.nextafter(radius_mm.max(), np.inf), NARROWEST_MM), rings + 1)
    sector_edges_deg = np.linspace(0, 360, sectors + 1)
    ring = np.searchsorted(ring_edges_mm, radius_mm, side="right") - 1
    cell = ring * sectors + np.minimum((azimuth_deg * sectors / 360).astype(int), sectors - 1)
    slice_edges_mm = at_mm + thickness_mm * np.array([-0.5, 0.5])
    edges = (slice_edges_mm, ring_edges_mm, sector_edges_deg)
    (measured_mm3,) = cell_volumes_mm3(axis, sample.box_mm, edges, sample.share_measured)
    whole_mm3 = np.pi * np.diff(ring_edges_mm**2)[:, None] * thickness_mm / sectors * np.ones(sectors)
    covered = measured_mm3 / whole_mm3
    flow = axial_volumes(chosen, axis)
    told = {
        "at_mm": at_mm,
        "thickness_mm": thickness_mm,
        "n": len(chosen),
        "weighting": "liquid that flows along the axis" if chosen.paired.any() else "liquid that is there",
        "ring_edges_mm": tuple(ring_edges_mm.tolist()),
        "sectors": sectors,
        "azimuths": tuple(map(direction_name, axis.frame[1:])),
        "liquid_ppm": _liquid_ppm(chosen, cell, sample.exposures * measured_mm3, covered),
        **_shares(chosen, cell, flow, covered),
    }
    return Patternation.model_validate(told)


def _liquid_ppm(
    sample: SpraySample, cell: NDArray[np.intp], seen_mm3: FloatArray, covered: FloatArray
) -> list[list[float | None]]:
    """Of the volume of each cell that could be measured, of all exposures together."""
    liquid = MM3_PER_UM3 * np.pi / 6 * np.bincount(cell, sample.cubes_um3, covered.size).reshape(covered.shape)
    with np.errstate(invalid="ignore", divide="ignore"):
        ppm = 1e6 * liquid / seen_mm3
    return [
        [value if known else None for value, known in zip(values, knowns, strict=True)]
        for values, knowns in zip(ppm.tolist(), (covered >= LEAST_COVERED).tolist(), strict=True)
    ]


def _shares(sample: SpraySample, cell: NDArray[np.intp], flow: FloatArray, covered: FloatArray) -> dict[str, object]:
    if (covered < LEAST_COVERED).any():
        return {
            "reason": "the box does not hold the spray all around at this distance, or liquid hides a part of it: "
            "measure a wider box, nearer to the nozzle, or farther from where liquid hangs together"
        }
    whole_flow = flow / covered.ravel()[cell]
    if whole_flow.sum() <= 0:
        return {"reason": "nothing flows along the axis in the mean: are nozzle and axis stated rightly?"}
    sectors = covered.shape[1]
    estimates = _estimated_shares(sample, cell, whole_flow, covered.shape)
    by_sector = _by_cell(sample, cell, whole_flow, covered.shape).sum(1)
    return {
        "sector_shares": tuple(estimates[:sectors]),
        "ring_shares": tuple(estimates[sectors:]),
        "asymmetry": float(_asymmetry(by_sector.sum(0))),
        "asymmetry_by_chance": sample.widening * _by_chance(by_sector),
    }


def _estimated_shares(
    sample: SpraySample, cell: NDArray[np.intp], flow: FloatArray, shape: tuple[int, ...]
) -> list[Estimate | None]:
    """Of all that flows, first of every sector, then of every ring."""
    sectors = shape[1]

    def shares_of(drawn: SpraySample) -> Figures:
        per_unit = _by_cell(drawn, cell, flow, shape)
        by_share = np.column_stack([per_unit.sum(1), per_unit.sum(2)])

        def shares(counts: FloatArray) -> FloatArray:
            parts = counts @ by_share
            with np.errstate(invalid="ignore", divide="ignore"):
                return np.asarray(parts / parts[:, :sectors].sum(1, keepdims=True))

        return shares

    return [one and _possible(one, len(sample)) for one in sample.estimated(shares_of, signed=True)]


def _possible(share: Estimate, n: int) -> Estimate:
    """The same within 0 and 1; where none of n droplets is, up to what counting allows."""
    most = garwood(0)[1] / n if share.value == 0 else 0.0
    return share.no_surer_than(Estimate(value=0.0, low=share.low, high=most)).within(0.0, 1.0)


def _by_cell(sample: SpraySample, cell: NDArray[np.intp], flow: FloatArray, shape: tuple[int, ...]) -> FloatArray:
    """What flows in every cell, by units: (units, rings, sectors)."""
    per_unit = np.zeros((sample.n_units, int(np.prod(shape))))
    np.add.at(per_unit, (sample.units, cell), flow)
    return per_unit.reshape(-1, *shape)


def _asymmetry(liquid: FloatArray) -> FloatArray:
    """Of liquid by sectors, the last axis."""
    share = liquid / liquid.sum(-1, keepdims=True)
    return np.asarray(np.abs(share - 1 / liquid.shape[-1]).sum(-1) / 2)


def _by_chance(by_sector: FloatArray) -> float:
    rng = np.random.default_rng(SEED)
    units, sectors = by_sector.shape
    turned = np.empty((DRAWS, sectors))
    for draw in range(DRAWS):
        places = (np.arange(sectors) + rng.integers(0, sectors, (units, 1))) % sectors
        turned[draw] = np.take_along_axis(by_sector, places, axis=1).sum(0)
    return float(np.quantile(_asymmetry(turned), CONFIDENCE))
