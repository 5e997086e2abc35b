"""SpraySample: the droplets of some shots together, and what is drawn to say how sure their figures are."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from processing.analysis.cells import PLANES, measured_shares
from processing.analysis.droplets.droplet_file import StoredDroplets
from processing.analysis.droplets.droplet_statistics import DIAMETER, measured_grid, measured_mm3, told_exposures
from processing.analysis.estimates import CONFIDENCE, COUNTED_DRAWS, DRAWS, FEW_SHOTS, Estimate, Figures, estimated
from processing.geometry import FloatArray
from processing.volume import VoxelGrid

VELOCITY = ("u_m_s", "v_m_s", "w_m_s")
LEAST_SHARE = 1e-9
"""Of a column of cells that could be measured: where none could, the quotient is 0."""


@dataclass(frozen=True, eq=False)
class SpraySample:
    """Droplets of some shots.

    Parameters
    ----------
    diameters_um : (N,) array
        Of all droplets in all exposures.
    points_mm : (N, 3) array
        x, y, z.
    velocities_m_s : (N, 3) array
        u, v, w; not a number where a droplet has none.
    shot : (N,) array of int
        Of which shot a droplet is.
    volumes_mm3 : (S,) array
        That could be measured in each shot, of all its exposures together.
    exposures_per_shot : float
        2 where A and B, which show the same droplets, are both there.
    box_mm : (2, 3) array | None
        Lower and upper corner of what was measured in every shot; None where shots differ in it.
    measured_shares : dict of plane to (S, rows, columns) array
        Of each cell of the box over two axes, what could be measured: shares, added up over the exposures of a shot;
        empty where a file does not say, or shots differ in their box.
    """

    diameters_um: FloatArray
    points_mm: FloatArray
    velocities_m_s: FloatArray
    shot: NDArray[np.intp]
    volumes_mm3: FloatArray
    exposures_per_shot: float = 1.0
    box_mm: FloatArray | None = None
    measured_shares: Mapping[str, FloatArray] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.diameters_um)

    @property
    def several(self) -> bool:
        """Whether there are shots to draw; of a single one droplets are drawn."""
        return len(self.volumes_mm3) > 1

    @property
    def exposures(self) -> float:
        """How many they are, of all shots together."""
        return len(self.volumes_mm3) * self.exposures_per_shot

    @property
    def has_empty_shots(self) -> bool:
        """Whether shots have no droplets: then totals have no logarithm, and their intervals are of themselves."""
        return bool(len(np.unique(self.shot)) < len(self.volumes_mm3))

    @property
    def paired(self) -> NDArray[np.bool_]:
        """Which droplets have a velocity, (N,)."""
        return np.asarray(np.isfinite(self.velocities_m_s).all(axis=1), np.bool_)

    @property
    def flying(self) -> "SpraySample":
        """Its droplets that have a velocity, and do not stand still: only these say where they come from."""
        return self.chosen(self.paired & (self.velocities_m_s != 0).any(axis=1))

    @property
    def cubes_um3(self) -> FloatArray:
        """Diameters to the third: volumes, but for pi / 6; (N,)."""
        return self.diameters_um**3

    @property
    def widening(self) -> float:
        """Of what draws say: two exposures of one shot show the same droplets, and make nothing surer."""
        return 1.0 if self.several else float(np.sqrt(self.exposures_per_shot))

    @property
    def n_units(self) -> int:
        """How many things there are to draw."""
        return len(self.volumes_mm3) if self.several else len(self)

    @cached_property
    def units(self) -> NDArray[np.intp]:
        """Of which of the drawn things a droplet is, (N,)."""
        return self.shot if self.several else np.arange(len(self))

    def chosen(self, which: NDArray[np.bool_]) -> "SpraySample":
        """The same shots with some of their droplets."""
        return replace(
            self,
            diameters_um=self.diameters_um[which],
            points_mm=self.points_mm[which],
            velocities_m_s=self.velocities_m_s[which],
            shot=self.shot[which],
        )

    def totals(self, values: FloatArray) -> Figures:
        """Sums of values of the droplets, (N, k), as a function of how often each unit is taken: (rows, k)."""
        per_unit = np.column_stack([np.bincount(self.units, column, self.n_units) for column in values.T])
        return lambda counts: counts @ per_unit

    def measured_mm3(self, counts: FloatArray) -> FloatArray:
        """Volumes that belong to so many shots, (rows, 1)."""
        if self.several:
            return counts @ self.volumes_mm3[:, None]
        return np.full((len(counts), 1), self.volumes_mm3.sum())

    def share_measured(self, points_mm: FloatArray) -> FloatArray:
        """Of the exposures, those that could be measured at places (N, 3) in the box; alike where files do not say.

        Two maps tell: over x and y, mean along z, and over x and z, mean along y. At each x they are taken for
        independent.
        """
        if self.box_mm is None:
            return np.ones(len(points_mm))
        if not set(PLANES) <= self.measured_shares.keys():
            whole_mm3 = self.exposures * np.prod(np.diff(self.box_mm, axis=0))
            return np.full(len(points_mm), self.volumes_mm3.sum() / whole_mm3)
        by_y, by_z = (self.measured_shares[plane].sum(axis=0) / self.exposures for plane in PLANES)
        cells = np.array([by_y.shape[1], len(by_y), len(by_z)])
        places = cells * (points_mm - self.box_mm[0]) / np.diff(self.box_mm, axis=0)
        x, y, z = np.clip(places.astype(int), 0, cells - 1).T
        return np.asarray(by_y[y, x] * by_z[z, x] / np.maximum(by_y.mean(axis=0), LEAST_SHARE)[x])

    @cached_property
    def as_one_shot(self) -> "SpraySample":
        """The same droplets as if one shot had them all: then droplets are drawn."""
        together = {plane: shares.sum(axis=0, keepdims=True) for plane, shares in self.measured_shares.items()}
        return replace(
            self,
            shot=np.zeros_like(self.shot),
            volumes_mm3=self.volumes_mm3.sum(keepdims=True),
            measured_shares=together,
        )

    def estimated(
        self,
        figures_of: "FiguresOf",
        signed: bool | NDArray[np.bool_] = False,
        confidence: float = CONFIDENCE,
        *,
        by_droplet: bool = False,
    ) -> list[Estimate | None]:
        """Figures with intervals over shots; of a single shot over its droplets, whose number is left to chance.

        Of few shots they are nowhere narrower than those over droplets. Figures that look at every droplet by itself
        say so: fewer draws are then made at once.
        """
        told = self._drawn(figures_of, signed, confidence, by_droplet)
        if not self.several or len(np.unique(self.shot)) >= FEW_SHOTS:
            return told
        counted = self.as_one_shot._drawn(figures_of, signed, confidence, by_droplet, COUNTED_DRAWS)
        return [one and one.no_surer_than(other) for one, other in zip(told, counted, strict=True)]

    def _drawn(
        self,
        figures_of: "FiguresOf",
        signed: bool | NDArray[np.bool_],
        confidence: float,
        by_droplet: bool,
        number: int = DRAWS,
    ) -> list[Estimate | None]:
        return estimated(
            figures_of(self),
            self.n_units,
            len(self) if by_droplet else 1,
            counting=not self.several,
            number=number,
            widening=self.widening,
            signed=signed,
            confidence=confidence,
        )


FiguresOf = Callable[[SpraySample], Figures]
"""Figures of a sample, as a function of how often each of its units is taken."""


def spray_sample(shots: Sequence[StoredDroplets]) -> SpraySample:
    """Droplets of shots as their files have them; shots of which every exposure was refused do not count.

    Parameters
    ----------
    shots : sequence of StoredDroplets
        With diameters in micrometres, of one recipe.
    """
    told = [(shot, told_exposures(shot)) for shot in shots]
    counted = [(shot, exposures) for shot, exposures in told if exposures]
    box_mm = _common_box([shot for shot, _ in counted])
    return SpraySample(
        diameters_um=_joined([np.asarray(shot.columns[DIAMETER], np.float64) for shot, _ in counted]),
        points_mm=_joined([_columns(shot, ("x_mm", "y_mm", "z_mm")) for shot, _ in counted], 3),
        velocities_m_s=_joined([_columns(shot, VELOCITY) for shot, _ in counted], 3),
        shot=np.repeat(np.arange(len(counted)), [len(shot.columns["frame"]) for shot, _ in counted]),
        volumes_mm3=np.array([measured_mm3(shot, exposures) for shot, exposures in counted], np.float64),
        exposures_per_shot=sum(len(exposures) for _, exposures in counted) / max(len(counted), 1),
        box_mm=box_mm,
        measured_shares={} if box_mm is None else measured_shares([exposures for _, exposures in counted], box_mm),
    )


def _joined(columns: Sequence[FloatArray], width: int = 0) -> FloatArray:
    return np.concatenate([np.empty((0, width) if width else 0), *columns])


def _columns(shot: StoredDroplets, names: Sequence[str]) -> FloatArray:
    """Columns side by side; not a number where a file has them not."""
    nothing = np.full(len(shot.columns["frame"]), np.nan)
    return np.column_stack([np.asarray(shot.columns.get(name, nothing), np.float64) for name in names])


def _common_box(shots: Sequence[StoredDroplets]) -> FloatArray | None:
    grids = {measured_grid(shot) for shot in shots}
    if len(grids) != 1 or (grid := grids.pop()) is None:
        return None
    return bounds_mm(grid)


def bounds_mm(grid: VoxelGrid) -> FloatArray:
    """Lower and upper corner of a grid, (2, 3): half a voxel beyond its outermost centres."""
    first, last = np.array([[axis[0], axis[-1]] for axis in (grid.x_mm, grid.y_mm, grid.z_mm)]).T
    return np.array([first - grid.pitch_mm / 2, last + grid.pitch_mm / 2])


def box_told(grid: VoxelGrid) -> str:
    """For people: where a grid reaches along x, y and z."""
    ends_mm = (bounds_mm(grid).round(3) + 0.0).T.tolist()  # no zero has a sign
    told = (f"{name} {low:g} to {high:g}" for name, (low, high) in zip("xyz", ends_mm, strict=True))
    return f"{', '.join(told)} mm"
