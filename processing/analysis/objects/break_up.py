"""How far liquid hangs together with the nozzle, in one exposure: along the axis of the spray, at several thresholds.

Bodies closer than a pixel look like one: what is told is where a gap can be seen.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from processing.analysis.objects.dark_voxels import FULL, DarkVoxels, connected
from processing.analysis.objects.liquid_objects import at_faces
from processing.geometry import FloatArray

THRESHOLDS = (0.2, 0.3, 0.4, 0.5)
"""A film of liquid lets light through: below 0.2 unsharp edges are bridges, above 0.5 films have holes."""
TELLING = (0.2, 0.3)
"""By these the break-up length is told: liquid that hangs together at one of them does so by half. At 0.4 thin film has
holes: without their blur, simulated fans break up 0.2 mm too early by it."""
THRESHOLD = 0.3
"""Of objects, and of whether anything is known of the liquid at the nozzle."""
NEAR_MM = 0.3
"""Liquid begins so close to the nozzle, as it is stated."""
LEAST_ALONG, JUDGED_MM = 0.4, 1.0
"""Of how far liquid goes from the nozzle, what it does along the axis: a cone of 130 degrees. Of longer bodies only."""
BLACK, BLACK_CORE_MM = 0.9, 1.0
"""Where all views are so black over half of a length, as wide as that, nobody knows whether it is one body."""


@dataclass(frozen=True)
class Nozzle:
    """Where the liquid comes from.

    Parameters
    ----------
    point_mm : (x, y, z)
        Middle of the orifice.
    axis : (x, y, z)
        Direction of the spray, of any length but 0.
    """

    point_mm: tuple[float, float, float]
    axis: tuple[float, float, float] = (0.0, 1.0, 0.0)

    def along_mm(self, points_mm: FloatArray) -> FloatArray:
        """Distances (N,) of points (N, 3) along the axis."""
        axis = np.array(self.axis) / np.linalg.norm(self.axis)
        return np.asarray((points_mm - np.array(self.point_mm)) @ axis, dtype=np.float64)

    def distances_mm(self, points_mm: FloatArray) -> FloatArray:
        """Distances (N,) of points (N, 3) from the orifice."""
        return np.asarray(np.linalg.norm(points_mm - np.array(self.point_mm), axis=1), dtype=np.float64)


@dataclass(frozen=True)
class Reach:
    """How far liquid hangs together with the nozzle.

    Parameters
    ----------
    thresholds : tuple of float
        Of darkness.
    reach_mm : tuple of float
        Along the axis at each; 0 where nothing at the nozzle is so dark.
    open : tuple of bool
        Whether what hangs together leaves what all views see: then it is longer.
    voxel_mm : float
        Width of the voxels that hang together.
    reason : str | None
        Why nothing is known; then there are no lengths.
    apart_mm : (float, float) | None
        Along the axis, from where to where a body goes that is long, too, and does not hang together with the nozzle.
    """

    thresholds: tuple[float, ...] = ()
    reach_mm: tuple[float, ...] = ()
    open: tuple[bool, ...] = ()
    voxel_mm: float = 0.0
    reason: str | None = None
    apart_mm: tuple[float, float] | None = None
    behind_mm: float = 0.0


def reach_of(voxels: DarkVoxels, nozzle: Nozzle) -> Reach:
    """How far dark voxels hang together with a nozzle, at all ``THRESHOLDS``."""
    outside = np.maximum(np.abs(_from_middle(voxels, nozzle)) - _half(voxels), 0)
    if np.linalg.norm(outside) * voxels.grid.pitch_mm > NEAR_MM:
        return Reach(reason=_not_seen(voxels, nozzle))
    judged = list(_bodies(voxels, nozzle))
    main = judged[THRESHOLDS.index(THRESHOLD)]
    if not len(main):
        return Reach(reason=f"no liquid within {NEAR_MM} mm of the nozzle at {_place(nozzle)}: is it stated rightly?")
    if (width_mm := black_width_mm(main, nozzle)) > BLACK_CORE_MM:
        return Reach(
            reason=f"all views are black over {width_mm:.1f} mm: one body, or a cloud too dense to see through"
        )
    if (aside := _goes_aside(main, nozzle)) is not None:
        return Reach(reason=aside)
    reach_mm, leaves = zip(*(_reach(body, nozzle) for body in judged), strict=True)
    behind_mm = max(-float(nozzle.along_mm(main.points_mm).min()), 0.0)
    return Reach(THRESHOLDS, reach_mm, leaves, main.grid.pitch_mm, behind_mm=behind_mm)


def _goes_aside(body: DarkVoxels, nozzle: Nozzle) -> str | None:
    """Why the axis is not that of the liquid, if it goes elsewhere."""
    far_mm = float(nozzle.distances_mm(body.points_mm).max())
    along_mm, _ = _reach(body, nozzle)
    if far_mm <= JUDGED_MM or along_mm >= LEAST_ALONG * far_mm:
        return None
    return (
        f"liquid goes {far_mm:.2f} mm from the nozzle, but {along_mm:.2f} mm along its axis "
        f"({', '.join(f'{value:g}' for value in nozzle.axis)}): is the axis stated rightly? If it is the nozzle that "
        "is seen, leave its pixels unasked (--ignore)"
    )


def core_of(voxels: DarkVoxels, objects: NDArray[np.int32], nozzle: Nozzle) -> NDArray[np.bool_]:
    """Which objects (N,) hang together with the nozzle."""
    core = np.zeros(int(objects.max(initial=-1)) + 1, bool)
    core[objects[nozzle.distances_mm(voxels.points_mm) <= NEAR_MM]] = True
    return core


def black_width_mm(body: DarkVoxels, nozzle: Nozzle) -> float:
    """Width of a square as large as the cross-section in which all views are black; median over the length."""
    layers = np.rint(nozzle.along_mm(body.points_mm) / body.grid.pitch_mm).astype(np.int64)
    black = np.bincount(layers - layers.min(), body.darkness >= BLACK * FULL)
    return float(np.sqrt(np.median(black)) * body.grid.pitch_mm)


def at_nozzle(voxels: DarkVoxels, nozzle: Nozzle) -> DarkVoxels:
    """What hangs together with a nozzle."""
    objects = connected(voxels)
    return voxels.where(core_of(voxels, objects, nozzle)[objects])


def _bodies(body: DarkVoxels, nozzle: Nozzle) -> Iterator[DarkVoxels]:
    """What hangs together with the nozzle at each threshold: of darker voxels, a part of what does at the last one."""
    for threshold in THRESHOLDS:
        body = at_nozzle(body.at_least(threshold), nozzle)
        yield body


def _reach(body: DarkVoxels, nozzle: Nozzle) -> tuple[float, bool]:
    """Length along the axis, and whether it leaves the grid before the nozzle, farther from it than liquid begins."""
    if not len(body):
        return 0.0, False
    points_mm, along_mm = body.points_mm, nozzle.along_mm(body.points_mm)
    leaves = at_faces(body) & (nozzle.distances_mm(points_mm) > 2 * NEAR_MM) & (along_mm > 0)
    return float(along_mm.max()) + body.grid.pitch_mm / 2, bool(leaves.any())


def _half(voxels: DarkVoxels) -> FloatArray:
    return np.array(voxels.grid.shape, np.float64) / 2


def _from_middle(voxels: DarkVoxels, nozzle: Nozzle) -> FloatArray:
    return voxels.grid.to_index(np.array(nozzle.point_mm)) + 0.5 - _half(voxels)


def _place(nozzle: Nozzle) -> str:
    return ", ".join(f"{value:g}" for value in nozzle.point_mm) + " mm"


def _not_seen(voxels: DarkVoxels, nozzle: Nozzle) -> str:
    grid = voxels.grid
    spans = (
        f"{name} {axis[0]:.1f} to {axis[-1]:.1f}"
        for name, axis in zip("xyz", (grid.x_mm, grid.y_mm, grid.z_mm), strict=True)
    )
    return f"the nozzle at {_place(nozzle)} lies outside of what all views see ({', '.join(spans)} mm)"
