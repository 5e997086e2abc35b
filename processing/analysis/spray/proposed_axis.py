"""Nozzle and axis that nobody stated, proposed from how droplets fly: away from the nozzle, around the axis.

Lines along the velocities meet near the nozzle. Scatter of the velocities draws the point that is nearest to all of
them towards the droplets; that is taken off. The axis is the mean direction where the box does not cut the spray, if it
is alike on both sides of it.
"""

from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from processing.analysis.estimates import Estimate, Figures
from processing.analysis.spray.cone import lean_of
from processing.analysis.spray.spray_axis import SprayAxis
from processing.analysis.spray.spray_sample import SpraySample
from processing.geometry import FloatArray
from processing.reconstruction.settings import FrozenValue

FEWEST = 100
"""Droplets with a velocity."""
MOST_UNLIKE = 0.2
"""Half the sum of the differences between opposite sectors, over all droplets: gusts have less, and chance of few makes
the root of their number more."""
SURER = 1.5
"""Times an interval, which has 95 %: 99 and more."""
MOST_BEHIND = 0.05
"""Of the droplets, behind a nozzle; some are carried back."""
MOST_UNSURE = 0.5
"""Width of the interval of the nozzle along the axis, over its distance from the middle of the droplets."""
LEAST_APART = 3.0
"""Mean square of the angles by which directions differ, in the plane where they differ least, over that of their
scatter: of less the nozzle is found millimetres off, beside an interval that does not know it (measured: below 2.3)."""
MOST_SWIRL = 0.1
"""Of the mean radial direction, around the axis: more draws the nozzle farther than its interval says."""
SLICES, WIDER, MOST_CUT = 8, 1.2, 0.02
"""Across the axis, of equal numbers of droplets; those that would be outside the box if they were a fifth farther from
the axis are at its sides, and a slice that has more of them is cut."""
SECTORS, ROUNDS = 8, 3
WILD, TRIMMED = 9.0, 6
"""Times the mean square of the scatter: 1 of 8000 normal flights is beyond; and how often those beyond are left out.
Two of a hundred that fly anywhere, as with wrong partners, drew the nozzle by a millimetre."""
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
AMID = "lines along the velocities meet amid the droplets: that is no nozzle; state nozzle and axis"
CUT = "the box cuts the spray at its sides all along, so its axis is not known: state nozzle and axis, or widen the box"
SCATTERED = (
    "velocities scatter nearly as much as directions of the spray differ, so lines along them do not say where they "
    "meet: state the nozzle"
)
PARALLEL = "droplets fly too much alike to say where they come from: state the nozzle"


def proposed_axis(sample: SpraySample) -> ProposedAxis:
    """Propose nozzle and axis of a spray, or say why not.

    Parameters
    ----------
    sample : SpraySample
        Its droplets; those with a velocity have a say.
    """
    moving = sample.flying
    if len(moving) < FEWEST:
        return ProposedAxis(reason=NO_VELOCITIES)
    flying = moving.chosen(_together(moving))
    if len(flying) < FEWEST:
        return ProposedAxis(reason=NO_VELOCITIES)
    nozzle = _nozzle(flying)
    nozzle_mm = np.array([one.value for one in nozzle])
    if len(nozzle) < 3:
        return ProposedAxis(reason=NOT_ALIKE)
    x, y, z = nozzle
    main = SprayAxis((*nozzle_mm,), _direction(flying)[0])
    missing = _no_nozzle(main, flying, np.array([one.high - one.low for one in nozzle]))
    place = None if missing else (x, y, z)
    whole = flying.chosen(_uncut(main, flying))
    if missing == AMID or len(whole) < FEWEST:
        return ProposedAxis(nozzle_mm=place, reason=missing or CUT)
    axis, within_deg = _direction(whole)
    if _lopsided(SprayAxis((*nozzle_mm,), axis), whole, within_deg):
        return ProposedAxis(reason=NOT_ALIKE)
    return ProposedAxis(nozzle_mm=place, axis=axis, axis_within_deg=within_deg, reason=missing)


def _no_nozzle(main: SprayAxis, flying: SpraySample, widths_mm: FloatArray) -> str | None:
    """Why lines along the velocities meet at no nozzle: a swirl, too much alike along the axis, amid the droplets."""
    along_mm, _, _ = main.coordinates(flying.points_mm)
    if _swirls(main, flying):
        return SWIRLS
    if np.linalg.norm(widths_mm * main.frame[0]) > MOST_UNSURE * abs(along_mm.mean()):
        return PARALLEL
    if np.mean(along_mm < 0) > MOST_BEHIND:
        return AMID
    return SCATTERED if _scattered(flying) else None


def _scattered(flying: SpraySample) -> bool:
    """Whether what scatter does to lines is about as much as what tells where they meet."""
    ways = _ways(flying)
    (least,) = np.linalg.eigvalsh(_matrices(_addends(ways, flying.points_mm).mean(axis=0)[None]))[:, 0]
    return bool(least < LEAST_APART * _scatter2(ways, flying.points_mm))


def _lopsided(axis: SprayAxis, whole: SpraySample, within_deg: float) -> bool:
    """Whether the mean direction is no axis: opposite sides have other numbers, or other angles from it."""
    if _unlike(axis, whole.points_mm) > MOST_UNLIKE + len(whole) ** -0.5:
        return True
    lean = lean_of(whole, whole.velocities_m_s, axis)
    return lean is not None and lean[0] > SURER * within_deg


def _nozzle(flying: SpraySample) -> list[Estimate]:
    """Where lines along the velocities meet: x, y, z, as far as they are known."""
    ways = _ways(flying)
    scatter2 = _scatter2(ways, flying.points_mm)

    def figures_of(drawn: SpraySample) -> Figures:
        sums = drawn.totals(_addends(ways, drawn.points_mm))
        return lambda counts: _nearest(sums(counts), scatter2)

    return [one for one in flying.estimated(figures_of, signed=True) if one is not None]


def _direction(flying: SpraySample) -> tuple[tuple[float, float, float], float]:
    """Mean direction, and within how many degrees it is known."""
    ways = _ways(flying)

    def mean_of(drawn: SpraySample) -> Figures:
        sums = drawn.totals(ways)
        return lambda counts: _units(sums(counts))

    told = flying.estimated(mean_of, signed=True)
    half = [0.5 * (one.high - one.low) for one in told if one is not None]
    ((u, v, w),) = _units(ways.sum(axis=0, keepdims=True)).tolist()
    return (u, v, w), float(np.degrees(np.linalg.norm(half)))


def _uncut(axis: SprayAxis, flying: SpraySample) -> NDArray[np.bool_]:
    """Droplets of those slices across the axis in which the box cuts off next to nothing at its sides.

    Where it does, the mean direction is drawn to the middle of the box.
    """
    if flying.box_mm is None:
        return np.ones(len(flying), np.bool_)
    along_mm, _, _ = axis.coordinates(flying.points_mm)
    middle_mm = np.array(axis.nozzle_mm) + along_mm[:, None] * axis.frame[0]
    wider_mm = middle_mm + WIDER * (flying.points_mm - middle_mm)
    cut = ((wider_mm < flying.box_mm[0]) | (wider_mm > flying.box_mm[1])).any(axis=1)
    place = np.argsort(np.argsort(along_mm, kind="stable"), kind="stable") * SLICES // len(flying)
    return np.asarray((np.bincount(place, cut, SLICES) <= MOST_CUT * np.bincount(place, minlength=SLICES))[place])


def _rounded(value: float, digits: int) -> str:
    """No zero has a sign."""
    return f"{round(value, digits) + 0.0:.{digits}f}"


def _addends(ways: FloatArray, points_mm: FloatArray) -> FloatArray:
    """What each droplet adds to the equations of the nearest point: (N, 13)."""
    across = np.eye(3) - ways[:, :, None] * ways[:, None, :]
    matrix = np.column_stack([across[:, one, other] for one, other in PAIRS])
    return np.column_stack([matrix, np.einsum("nij,nj->ni", across, points_mm), points_mm, np.ones(len(ways))])


def _nearest(sums: FloatArray, scatter2: float) -> FloatArray:
    """Points that are nearest to all lines, (rows, 3), of sums (rows, 13); of no droplets not a number."""
    count = sums[:, 12, None, None]
    right = sums[:, 6:9] - scatter2 * sums[:, 9:12]
    matrices = _matrices(sums) - scatter2 * count * np.eye(3)
    points = np.einsum("rij,rj->ri", np.linalg.pinv(matrices, hermitian=True), right)
    return np.where(count[:, :, 0] > 0, points, np.nan)


def _matrices(sums: FloatArray) -> FloatArray:
    """Of sums (rows, 13): how much lines tell of a place along every direction, (rows, 3, 3)."""
    matrices = np.empty((len(sums), 3, 3))
    for number, (one, other) in enumerate(PAIRS):
        matrices[:, one, other] = matrices[:, other, one] = sums[:, number]
    return matrices


def _scatter2(ways: FloatArray, points_mm: FloatArray) -> float:
    """Mean square of the angle by which droplets fly beside the line from the nozzle."""
    sums, scatter2 = _addends(ways, points_mm).sum(axis=0)[None], 0.0
    for _ in range(ROUNDS):
        missed2 = _missed2(ways, points_mm - _nearest(sums, scatter2)[0])
        scatter2 = float(np.median(missed2) / MEDIAN_OF_TWO)
    return scatter2


def _missed2(ways: FloatArray, from_mm: FloatArray) -> FloatArray:
    """Squares of the sines by which droplets fly beside the line from a place, (N,)."""
    missed_mm = from_mm - np.sum(from_mm * ways, axis=1, keepdims=True) * ways
    return np.asarray(np.sum(missed_mm**2, axis=1) / np.sum(from_mm**2, axis=1))


def _together(moving: SpraySample) -> NDArray[np.bool_]:
    """Droplets that fly along lines from one place, but for scatter: not mist, nor those with a wrong partner."""
    ways, addends = _ways(moving), _addends(_ways(moving), moving.points_mm)
    kept = np.ones(len(moving), np.bool_)
    for _ in range(TRIMMED):
        scatter2 = _scatter2(ways[kept], moving.points_mm[kept])
        (place_mm,) = _nearest(addends[kept].sum(axis=0)[None], scatter2)
        kept = _missed2(ways, moving.points_mm - place_mm) <= WILD * scatter2
    return kept


MEDIAN_OF_TWO = float(np.log(2))
"""Median over mean of a sum of two squares that are normal."""


def _ways(flying: SpraySample) -> FloatArray:
    """Directions in which droplets fly, (N, 3) of length 1."""
    return np.asarray(flying.velocities_m_s / np.linalg.norm(flying.velocities_m_s, axis=1, keepdims=True))


def _units(vectors: FloatArray) -> FloatArray:
    """The same directions, (rows, 3); of no droplets not a number."""
    with np.errstate(invalid="ignore"):
        return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True), dtype=np.float64)


def _unlike(axis: SprayAxis, points_mm: FloatArray) -> float:
    """How much opposite sectors around the axis differ: 0 is alike, 1 all on one side."""
    _, _, azimuth_deg = axis.coordinates(points_mm)
    counts = np.bincount((azimuth_deg * SECTORS / 360).astype(np.intp) % SECTORS, minlength=SECTORS)
    return float(np.abs(counts - np.roll(counts, SECTORS // 2)).sum() / 2 / counts.sum())


def _swirls(axis: SprayAxis, flying: SpraySample) -> bool:
    """Whether droplets fly around the axis, more than chance and more than a little of how they fly away from it."""
    ways = _ways(flying)
    _, radial = axis.components(ways, flying.points_mm)
    around = axis.around(ways, flying.points_mm)

    def around_of(drawn: SpraySample) -> Figures:
        sums = drawn.totals(np.column_stack([around, np.ones(len(around))]))
        return lambda counts: sums(counts)[:, :1] / np.maximum(sums(counts)[:, 1:], 1)

    (told,) = flying.estimated(around_of, signed=True)
    sure = told is not None and told.low * told.high > 0
    return sure and abs(around.mean()) > MOST_SWIRL * abs(radial.mean())
