"""Nozzle and axis that nobody stated, proposed from how droplets fly: away from the nozzle, around the axis.

Lines along the velocities meet near the nozzle. Scatter of the velocities draws the point that is nearest to all of
them towards the droplets; that is taken off. The axis is the mean direction, if the spray is alike on both sides of it.
"""

from typing import Annotated

import numpy as np
from pydantic import Field

from processing.analysis.estimates import Estimate, Figures
from processing.analysis.spray.spray_axis import SprayAxis
from processing.analysis.spray.spray_sample import SpraySample
from processing.geometry import FloatArray
from processing.reconstruction.settings import FrozenValue

FEWEST = 100
"""Droplets with a velocity."""
MOST_UNLIKE = 0.2
"""Half the sum of the differences between opposite sectors, over all droplets: chance and gusts have less."""
MOST_UNSURE = 0.5
"""Width of the interval of the nozzle along the axis, over its distance from the middle of the droplets."""
MOST_SWIRL = 0.1
"""Of the mean radial direction, around the axis: more draws the nozzle farther than its interval says."""
SECTORS, ROUNDS = 8, 3
PAIRS = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))


class ProposedAxis(FrozenValue):
    """Nozzle and axis as the droplets fly; a proposal, which figures do not use until somebody states it."""

    nozzle_mm: Annotated[
        tuple[Estimate, Estimate, Estimate] | None,
        Field(description="x, y, z of where the lines along the velocities meet: the orifice, or shortly behind it"),
    ] = None
    axis: Annotated[tuple[float, float, float] | None, Field(description="mean direction, a unit vector")] = None
    axis_within_deg: Annotated[float | None, Field(description="of the axis, with 95 %")] = None
    reason: Annotated[str | None, Field(description="why there is none, or no nozzle")] = None

    @property
    def believed(self) -> SprayAxis | None:
        """Nozzle and axis, where both are proposed."""
        if self.nozzle_mm is None or self.axis is None:
            return None
        x, y, z = (one.value for one in self.nozzle_mm)
        return SprayAxis((x, y, z), self.axis)

    @property
    def words(self) -> str:
        """For people: options to state it with, if it is believed, and how sure it is."""
        if self.nozzle_mm is None or self.axis is None:
            return f"none is proposed: {self.reason}"
        place = ",".join(_rounded(one.value, 2) for one in self.nozzle_mm)
        unsure = ", ".join(f"{_rounded(one.low, 2)} to {_rounded(one.high, 2)}" for one in self.nozzle_mm)
        direction = ",".join(_rounded(one, 3) for one in self.axis)
        sure = f"95 %: {unsure} mm, axis within {self.axis_within_deg:.1f} degrees"
        return f"proposed by how droplets fly: --nozzle={place} --axis={direction} ({sure})"


NO_VELOCITIES = "fewer than 100 droplets have a velocity: measure double exposures, or state nozzle and axis"
NOT_ALIKE = (
    "the spray is not alike on both sides of its mean direction: it has no axis of symmetry, or the box cuts it to one "
    "side; state nozzle and axis"
)
SWIRLS = (
    "droplets fly around the axis, too (a swirl), so lines along their velocities do not meet at the nozzle: state it"
)
PARALLEL = "droplets fly too much alike to say where they come from: state the nozzle"


def proposed_axis(sample: SpraySample) -> ProposedAxis:
    """Propose nozzle and axis of a spray, or say why not.

    Parameters
    ----------
    sample : SpraySample
        Its droplets; those with a velocity have a say.
    """
    paired = sample.chosen(sample.paired)
    speeds_m_s = np.linalg.norm(paired.velocities_m_s, axis=1, keepdims=True)
    flying = paired.chosen(speeds_m_s[:, 0] > 0)
    if len(flying) < FEWEST:
        return ProposedAxis(reason=NO_VELOCITIES)
    ways = flying.velocities_m_s / np.linalg.norm(flying.velocities_m_s, axis=1, keepdims=True)
    scatter2 = _scatter2(ways, flying.points_mm)

    def figures_of(drawn: SpraySample) -> Figures:
        sums = drawn.totals(_addends(ways, drawn.points_mm))
        return lambda counts: _figures(sums(counts), scatter2)

    told = flying.estimated(figures_of, signed=True)
    axis = _unit(ways.mean(axis=0))
    nozzle = [one for one in told[:3] if one is not None]
    nozzle_mm = np.array([one.value for one in nozzle])
    if len(nozzle) < 3 or _unlike(SprayAxis((*nozzle_mm,), (*axis,)), flying.points_mm) > MOST_UNLIKE:
        return ProposedAxis(reason=NOT_ALIKE)
    across = [0.5 * (one.high - one.low) for one in told[3:] if one is not None]
    within_deg = float(np.degrees(np.linalg.norm(across)))
    widths_mm = np.array([one.high - one.low for one in nozzle])
    far_mm = abs((flying.points_mm.mean(axis=0) - nozzle_mm) @ axis)
    reason = PARALLEL if np.linalg.norm(widths_mm * axis) > MOST_UNSURE * far_mm else None
    reason = SWIRLS if _swirls(SprayAxis((*nozzle_mm,), (*axis,)), flying) else reason
    x, y, z = nozzle
    u, v, w = axis.tolist()
    return ProposedAxis(
        nozzle_mm=None if reason else (x, y, z), axis=(u, v, w), axis_within_deg=within_deg, reason=reason
    )


def _rounded(value: float, digits: int) -> str:
    """No zero has a sign."""
    return f"{round(value, digits) + 0.0:.{digits}f}"


def _addends(ways: FloatArray, points_mm: FloatArray) -> FloatArray:
    """What each droplet adds to the equations of the nearest point: (N, 16)."""
    across = np.eye(3) - ways[:, :, None] * ways[:, None, :]
    matrix = np.column_stack([across[:, one, other] for one, other in PAIRS])
    return np.column_stack([matrix, np.einsum("nij,nj->ni", across, points_mm), points_mm, ways, np.ones(len(ways))])


def _figures(sums: FloatArray, scatter2: float) -> FloatArray:
    """Nearest point and direction (rows, 6) of sums (rows, 16); of no droplets not a number."""
    matrix = np.empty((len(sums), 3, 3))
    for number, (one, other) in enumerate(PAIRS):
        matrix[:, one, other] = matrix[:, other, one] = sums[:, number]
    count = sums[:, 15, None, None]
    right = sums[:, 6:9] - scatter2 * sums[:, 9:12]
    points = np.einsum("rij,rj->ri", np.linalg.pinv(matrix - scatter2 * count * np.eye(3), hermitian=True), right)
    with np.errstate(invalid="ignore"):
        directions = sums[:, 12:15] / np.linalg.norm(sums[:, 12:15], axis=1, keepdims=True)
    return np.where(count[:, :, 0] > 0, np.hstack([points, directions]), np.nan)


def _scatter2(ways: FloatArray, points_mm: FloatArray) -> float:
    """Mean square of the angle by which droplets fly beside the line from the nozzle."""
    sums, scatter2 = _addends(ways, points_mm).sum(axis=0)[None], 0.0
    for _ in range(ROUNDS):
        from_mm = points_mm - _figures(sums, scatter2)[0, :3]
        missed_mm = from_mm - np.sum(from_mm * ways, axis=1, keepdims=True) * ways
        scatter2 = float(np.median(np.sum(missed_mm**2, axis=1) / np.sum(from_mm**2, axis=1)) / MEDIAN_OF_TWO)
    return scatter2


MEDIAN_OF_TWO = float(np.log(2))
"""Median over mean of a sum of two squares that are normal."""


def _unit(vector: FloatArray) -> FloatArray:
    return np.asarray(vector / np.linalg.norm(vector), dtype=np.float64)


def _unlike(axis: SprayAxis, points_mm: FloatArray) -> float:
    """How much opposite sectors around the axis differ: 0 is alike, 1 all on one side."""
    _, _, azimuth_deg = axis.coordinates(points_mm)
    counts = np.bincount((azimuth_deg * SECTORS / 360).astype(np.intp) % SECTORS, minlength=SECTORS)
    return float(np.abs(counts - np.roll(counts, SECTORS // 2)).sum() / 2 / counts.sum())


def _swirls(axis: SprayAxis, flying: SpraySample) -> bool:
    """Whether droplets fly around the axis, more than chance and more than a little of how they fly away from it."""
    ways = flying.velocities_m_s / np.linalg.norm(flying.velocities_m_s, axis=1, keepdims=True)
    _, radial = axis.components(ways, flying.points_mm)
    around = axis.around(ways, flying.points_mm)

    def around_of(drawn: SpraySample) -> Figures:
        sums = drawn.totals(np.column_stack([around, np.ones(len(around))]))
        return lambda counts: sums(counts)[:, :1] / np.maximum(sums(counts)[:, 1:], 1)

    (told,) = flying.estimated(around_of, signed=True)
    sure = told is not None and told.low * told.high > 0
    return sure and abs(around.mean()) > MOST_SWIRL * abs(radial.mean())
