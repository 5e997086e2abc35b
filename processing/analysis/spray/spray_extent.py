"""SprayExtent: cone angle and penetration, by shares of the liquid, so that nobody has to choose a threshold.

* *Cone angle*: twice the angle from the axis, seen from the nozzle, within which a share of the liquid of the box is:
  90 %, and 50 %, which in a hollow cone is where the cone is. Spatial: by what is there, not by what flows.
* *Penetration*: the distance from the nozzle along the axis beyond which 1 % of the liquid of the box is. It is known
  where the box holds the tip: where its last tenth has less than a tenth of the mean of the rest, and a tenth farther
  from the nozzle nine tenths of the liquid before the tip would still be in the box, and next to none of all liquid
  beyond its sides. Of a spray that goes on beyond the box, or leaves it by its sides, there is none. Nor of one with
  gaps, where the box ends no farther beyond the tip than a gap is long: more may follow. A box that ends in the first
  gap shows none, and nothing tells: ``not_checked`` says so.
"""

from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from processing.analysis.estimates import Estimate, Figures, weighted_quantiles
from processing.analysis.spray.spray_axis import SprayAxis, cell_volumes_mm3
from processing.analysis.spray.spray_sample import SpraySample
from processing.calibration.verdict import Unchecked
from processing.geometry import FloatArray
from processing.reconstruction.settings import FrozenValue

SHARES = (0.5, 0.9)
TIP_SHARE = 0.99
LEAST_COVERED = 0.9
"""Of the ring around the cone's edge, which the box must hold."""
EDGE = 0.1
"""Of the angle, to both sides: so wide is that ring; of the box's length: last part; of the liquid: beside a gap."""
MOST_LEAVING = 0.03
"""Of the liquid, about to leave the box by its sides: 6 % and more of a cone that does so, 2 at skirts of others."""
MOST_CUT = 0.015
"""The same, for an angle: of fans of which the sides cut a tenth it is 4 to 7 %, of cones of which they cut none 0."""
FEWEST = 20
CHANCE = 0.001
"""How often droplets that lie evenly along the axis have a gap as long."""
TINY_MM = 1e-12
TOO_NARROW = (
    "the box does not reach around the cone: it cuts off what flies farther out, and flux and densities are means over "
    "what it holds; measure a wider box"
)
GOES_ON = "the spray goes on beyond the box: measure a longer box, or earlier after the start of injection"
GAP = (
    "the box ends {:.2g} mm beyond the last liquid, and the spray has a gap of {:.2g} mm: more may follow; measure a "
    "longer box"
)
LEAVES = "the spray leaves the box by its sides before it ends: measure a wider box"
TOO_FEW = f"fewer than {FEWEST} droplets beyond the nozzle"
NO_BOX = "shots were measured in several boxes, or no file says in which: measure all of them in one"


class SprayExtent(FrozenValue):
    """How wide and how far a spray goes."""

    cone_angle_deg: Annotated[Estimate | None, Field(description="whole angle that holds 90 % of the liquid")] = None
    cone_angle_half_deg: Annotated[Estimate | None, Field(description="whole angle that holds 50 % of the liquid")] = (
        None
    )
    cone_reason: Annotated[str | None, Field(description="why there is no angle")] = None
    penetration_mm: Annotated[
        Estimate | None, Field(description="distance along the axis beyond which 1 % of the liquid of the box is")
    ] = None
    penetration_reason: Annotated[str | None, Field(description="why there is no penetration")] = None
    clear_mm: Annotated[
        float | None, Field(description="from the penetration to the end of the box: in it next to nothing is")
    ] = None

    @property
    def not_checked(self) -> tuple[Unchecked, ...]:
        """What a box cannot tell of what is beyond it."""
        if self.clear_mm is None:
            return ()
        return (
            Unchecked(
                f"whether more of the spray is beyond the box, behind a gap of {self.clear_mm:.2g} mm or more: "
                "penetration is that of what the box holds",
                "nothing where it is one cloud, as after the start of injection; else measure a box up to where "
                "nothing can be yet",
            ),
        )


def spray_extent(sample: SpraySample, axis: SprayAxis) -> SprayExtent:
    """Cone angle and penetration of a sample.

    Parameters
    ----------
    sample : SpraySample
        The droplets.
    axis : SprayAxis
        Of the spray.
    """
    along_mm, radius_mm, _ = axis.coordinates(sample.points_mm)
    chosen = sample.chosen(along_mm > 0)
    missing = NO_BOX if sample.box_mm is None else TOO_FEW if len(chosen) < FEWEST else None
    if sample.box_mm is None or missing:
        return SprayExtent(cone_reason=missing, penetration_reason=missing)
    angles_deg = np.degrees(np.arctan2(radius_mm, along_mm))[along_mm > 0]
    half, most = _quantiles(chosen, 2 * angles_deg, SHARES)
    around = most is None or _covered(axis, sample.box_mm, most.value / 2) >= LEAST_COVERED
    wide_enough = around and not _cut(chosen, axis, sample.box_mm)
    (tip,) = _quantiles(chosen, along_mm[along_mm > 0], (TIP_SHARE,))
    goes_on = _goes_on(chosen, axis, sample.box_mm, tip.value if tip else 0.0)
    known = None if goes_on else tip
    return SprayExtent(
        cone_angle_deg=most if wide_enough else None,
        cone_angle_half_deg=half if wide_enough else None,
        cone_reason=None if wide_enough else TOO_NARROW,
        penetration_mm=known,
        penetration_reason=goes_on,
        clear_mm=None if known is None else axis.reach_mm(sample.box_mm)[1] - known.value,
    )


def _quantiles(sample: SpraySample, values: FloatArray, shares: tuple[float, ...]) -> list[Estimate | None]:
    order = np.argsort(values, kind="stable")
    sorted_values, cubes = values[order], sample.cubes_um3[order]

    def quantiles_of(drawn: SpraySample) -> Figures:
        units = drawn.units[order]
        return lambda counts: weighted_quantiles(sorted_values, counts[:, units] * cubes, shares)

    return sample.estimated(quantiles_of, by_droplet=True)


def _covered(axis: SprayAxis, box_mm: FloatArray, angle_deg: float) -> float:
    """Which part of the ring around an angle from the axis lies in the box, within the reach of its middle."""
    near_mm, far_mm = axis.reach_mm(box_mm)
    middle_mm, length_mm = (near_mm + far_mm) / 2, 0.5 * (far_mm - near_mm)
    tangents = np.tan(np.radians(np.minimum(angle_deg * np.array([1 - EDGE, 1 + EDGE]), 89)))
    edges_mm = (middle_mm + length_mm * np.array([-0.5, 0.5]), middle_mm * tangents, np.array([0, 360.0]))
    (((inside_mm3,),),) = cell_volumes_mm3(axis, box_mm, edges_mm)
    return float(inside_mm3 / (np.pi * np.diff(edges_mm[1] ** 2)[0] * length_mm))


def _goes_on(sample: SpraySample, axis: SprayAxis, box_mm: FloatArray, tip_mm: float) -> str | None:
    """Why the tip is not known: the last part of the box has liquid, or what is before the tip is about to leave it."""
    along_mm, _, _ = axis.coordinates(sample.points_mm)
    near_mm, far_mm = axis.reach_mm(box_mm)
    last, cubes = along_mm > far_mm - EDGE * (far_mm - near_mm), sample.cubes_um3
    if cubes[last].sum() >= EDGE * EDGE / (1 - EDGE) * cubes[~last].sum():
        return GOES_ON
    if (gap_mm := _longest_gap_mm(along_mm, cubes)) >= (clear_mm := far_mm - tip_mm):
        return GAP.format(clear_mm, gap_mm)
    leaves, by_its_sides = _leaving(sample, axis, box_mm)
    before = along_mm > (1 - EDGE) * tip_mm
    leaving = cubes[before & leaves].sum() > EDGE * cubes[before].sum()
    return LEAVES if leaving or cubes[by_its_sides].sum() > MOST_LEAVING * cubes.sum() else None


def _longest_gap_mm(along_mm: FloatArray, cubes: FloatArray) -> float:
    """Of no liquid, with a tenth of all on either side; 0 where chance makes as long a one."""
    order = np.argsort(along_mm)
    places_mm, shares = along_mm[order], np.cumsum(cubes[order]) / cubes.sum()
    within_mm = places_mm[(shares >= EDGE) & (shares <= 1 - EDGE)]
    gap_mm = float(np.diff(within_mm).max(initial=0.0))
    by_chance = len(within_mm) * (1 - gap_mm / max(float(np.ptp(within_mm)), gap_mm, TINY_MM)) ** len(within_mm)
    return gap_mm if by_chance < CHANCE else 0.0


def _cut(sample: SpraySample, axis: SprayAxis, box_mm: FloatArray) -> bool:
    """Whether liquid is about to leave the box by its sides: then more of it is beyond them."""
    _, by_its_sides = _leaving(sample, axis, box_mm)
    return bool(sample.cubes_um3[by_its_sides].sum() > MOST_CUT * sample.cubes_um3.sum())


def _leaving(sample: SpraySample, axis: SprayAxis, box_mm: FloatArray) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which droplets would be beyond the box a tenth farther from the nozzle, and which of them beyond its sides."""
    along_mm, _, _ = axis.coordinates(sample.points_mm)
    _, far_mm = axis.reach_mm(box_mm)
    farther_mm = np.array(axis.nozzle_mm) + (1 + EDGE) * (sample.points_mm - np.array(axis.nozzle_mm))
    leaves = ((farther_mm < box_mm[0]) | (farther_mm > box_mm[1])).any(axis=1)
    return leaves, leaves & ((1 + EDGE) * along_mm < far_mm)
