"""LiquidObjects: the connected objects of what all views see dark, each with its class, size and direction.

There is no volume of liquid: the hull holds 4 to 13 times as much. Length and width are from silhouettes, which are the
object's own as long as nothing else lies behind it or before it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from processing.analysis.objects.dark_voxels import DarkVoxels
from processing.analysis.objects.silhouettes import Shapes, shapes_of
from processing.geometry import FloatArray

ELONGATED = 1.8
"""A longer axis, over the next one, is no droplet's."""
LEAST_FILLING = 0.55
"""A silhouette that fills less of its ellipse has holes, or is several: a cluster."""
LEAST_LENGTH_VOXEL = 8.0
"""Shorter objects are droplets, as far as anyone can tell."""
LEAST_OWN_SHARE = 0.5
"""Of the silhouettes in three views: what has less may be a ghost."""
TOO_WIDE_VOXEL = 0.5
"""So much wider is a silhouette of whole cells, in the mean of width and thickness of blurred threads."""
STRIP, ELLIPSE = float(np.sqrt(12)), 4.0
"""Width of a strip, and axis of an ellipse, over the standard deviation of its area."""
Columns = dict[str, NDArray[np.generic]]


class ObjectClass(StrEnum):
    """What an object looks like."""

    DROPLET = "droplet"
    LIGAMENT = "ligament"
    SHEET = "sheet"
    CLUSTER = "cluster"
    CORE = "core"
    """Hangs together with the nozzle."""


@dataclass(frozen=True, eq=False)
class LiquidObjects:
    """Objects of one exposure, a row each.

    Parameters
    ----------
    points_mm : (N, 3) array
        Middles of the hulls.
    classes : (N,) array of ObjectClass
        What each looks like.
    lengths_mm, widths_mm, thicknesses_mm : (N,) arrays
        Along the longest, middle and shortest axis; width and thickness are those of what is half as dark as the object
        is at most, and a voxel at least.
    length_sd_mm : (N,) array
        Standard deviation of all three: a voxel, and what the silhouettes disagree on.
    directions : (N, 3) array
        Unit vector x, y, z along the longest axis, y >= 0; of a sheet, across it.
    own_share : (N,) array
        Of its silhouettes, in the third best view: not explained by a larger object.
    open : (N,) bool array
        Goes on beyond what all views see: longer than told.
    """

    points_mm: FloatArray
    classes: NDArray[np.str_]
    lengths_mm: FloatArray
    widths_mm: FloatArray
    thicknesses_mm: FloatArray
    length_sd_mm: FloatArray
    directions: FloatArray
    own_share: FloatArray
    open: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.classes)

    @classmethod
    def none(cls) -> "LiquidObjects":
        """No objects."""
        empty, vectors = np.empty(0), np.empty((0, 3))
        return cls(vectors, np.empty(0, "U8"), empty, empty, empty, empty, vectors, empty, np.empty(0, bool))

    @classmethod
    def of(cls, columns: Mapping[str, NDArray[np.generic]]) -> "LiquidObjects":
        """Objects of the columns of a file; no objects of none."""
        if not columns:
            return cls.none()

        def vectors(*names: str) -> FloatArray:
            return np.column_stack([np.asarray(columns[name], np.float64) for name in names])

        return cls(
            points_mm=vectors("x_mm", "y_mm", "z_mm"),
            classes=columns["class"].astype("U8"),
            lengths_mm=np.asarray(columns["length_mm"], np.float64),
            widths_mm=np.asarray(columns["width_mm"], np.float64),
            thicknesses_mm=np.asarray(columns["thickness_mm"], np.float64),
            length_sd_mm=np.asarray(columns["length_sd_mm"], np.float64),
            directions=vectors("direction_x", "direction_y", "direction_z"),
            own_share=np.asarray(columns["own_share"], np.float64),
            open=columns["open"].astype(bool),
        )

    @classmethod
    def joined(cls, parts: Sequence["LiquidObjects"]) -> "LiquidObjects":
        """Objects of several exposures, one below the other; at least one."""
        names = [field.name for field in fields(cls)]
        return cls(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in names})

    def where(self, chosen: NDArray[np.bool_]) -> "LiquidObjects":
        """The chosen ones."""
        return LiquidObjects(**{field.name: getattr(self, field.name)[chosen] for field in fields(self)})

    @property
    def is_told(self) -> NDArray[np.bool_]:
        """Which (N,) are liquid and no droplets, as far as their silhouettes tell."""
        return np.asarray((self.classes != ObjectClass.DROPLET) & (self.own_share >= LEAST_OWN_SHARE))

    def told(self) -> "LiquidObjects":
        """Those that are liquid and no droplets."""
        return self.where(self.is_told)

    def count(self, kind: ObjectClass) -> int:
        """How many are of a class."""
        return int(np.count_nonzero(self.classes == kind))

    def columns(self) -> Columns:
        """Columns by their names, as files have them."""
        return {
            **dict(zip(("x_mm", "y_mm", "z_mm"), self.points_mm.T, strict=True)),
            "class": self.classes.astype("S8"),
            "length_mm": self.lengths_mm,
            "width_mm": self.widths_mm,
            "thickness_mm": self.thicknesses_mm,
            "length_sd_mm": self.length_sd_mm,
            **dict(zip(("direction_x", "direction_y", "direction_z"), self.directions.T, strict=True)),
            "own_share": self.own_share,
            "open": self.open.astype(np.uint8),
        }


def liquid_objects(
    voxels: DarkVoxels, objects: NDArray[np.int32], sight: FloatArray, core: NDArray[np.bool_] | None = None
) -> LiquidObjects:
    """Shape and class of every object.

    Parameters
    ----------
    voxels : DarkVoxels
        At one threshold.
    objects : (voxels,) int array
        Of ``connected``.
    sight : (views, 2, 3) array
        Of ``sights``: at least three views.
    core : (N,) bool array, optional
        Objects that hang together with the nozzle.
    """
    if not len(voxels):
        return LiquidObjects.none()
    points_mm, pitch_mm = voxels.points_mm, voxels.grid.pitch_mm
    shapes = shapes_of(points_mm, objects, sight, pitch_mm)
    variances, axes = np.linalg.eigh(shapes.tensors_mm2)
    sds_mm = np.sqrt(np.maximum(variances[:, ::-1], pitch_mm**2 / 12))
    classes = _classes(sds_mm, shapes, pitch_mm)
    if core is not None:
        classes[core] = ObjectClass.CORE
    factors = np.where(classes == ObjectClass.LIGAMENT, STRIP, ELLIPSE)
    sizes_mm = sds_mm * factors[:, None]
    across_mm = factors[:, None] * _across_sds_mm(voxels, objects, sight, axes[:, :, 1::-1]) - TOO_WIDE_VOXEL * pitch_mm
    thicknesses_mm, widths_mm = np.sort(np.maximum(across_mm, pitch_mm), axis=1).T
    sheet = classes == ObjectClass.SHEET
    misfit_mm = factors**2 * shapes.misfit_mm2 / (2 * sizes_mm[:, 0])
    return LiquidObjects(
        _middles(points_mm, objects),
        classes,
        sizes_mm[:, 0],
        widths_mm,
        thicknesses_mm,
        np.hypot(pitch_mm, misfit_mm),
        _downwards(np.where(sheet[:, None], axes[:, :, 0], axes[:, :, 2])),
        shapes.own_share,
        _open(voxels, objects),
    )


def _across_sds_mm(voxels: DarkVoxels, objects: NDArray[np.int32], sight: FloatArray, axes: FloatArray) -> FloatArray:
    """Standard deviations (N, 2) along two axes (N, 3, 2) of what is half as dark as the darkest voxel of each object.

    That is where its edge is, however blurred; what hangs together is looked for in paler ones.
    """
    darkest = np.zeros(int(objects.max()) + 1)
    np.maximum.at(darkest, objects, voxels.darkness)
    inner = voxels.darkness >= darkest[objects] / 2
    tensors_mm2 = shapes_of(voxels.points_mm[inner], objects[inner], sight, voxels.grid.pitch_mm).tensors_mm2
    return np.asarray(np.sqrt(np.maximum(np.einsum("nia,nij,nja->na", axes, tensors_mm2, axes), 0)))


def _classes(sds_mm: FloatArray, shapes: Shapes, pitch_mm: float) -> NDArray[np.str_]:
    """Class of each by the standard deviations (N, 3) along its axes, longest first."""
    longer, flatter = sds_mm[:, 0] / sds_mm[:, 1], sds_mm[:, 1] / sds_mm[:, 2]
    classes = np.full(len(sds_mm), ObjectClass.DROPLET.value, "U8")
    long = ELLIPSE * sds_mm[:, 0] >= LEAST_LENGTH_VOXEL * pitch_mm
    classes[long & (flatter >= ELONGATED)] = ObjectClass.SHEET
    classes[long & (longer >= ELONGATED) & (longer >= flatter)] = ObjectClass.LIGAMENT
    classes[long & (shapes.filling < LEAST_FILLING)] = ObjectClass.CLUSTER
    return classes


def _middles(points_mm: FloatArray, objects: NDArray[np.int32]) -> FloatArray:
    sizes = np.bincount(objects)
    return np.stack([np.bincount(objects, axis_mm) / sizes for axis_mm in points_mm.T], axis=1)


def _downwards(vectors: FloatArray) -> FloatArray:
    return np.asarray(vectors * np.where(vectors[:, 1:2] < 0, -1.0, 1.0), dtype=np.float64)


def _open(voxels: DarkVoxels, objects: NDArray[np.int32]) -> NDArray[np.bool_]:
    """Which objects (N,) touch the faces of the grid."""
    return np.bincount(objects[at_faces(voxels)], minlength=int(objects.max()) + 1) > 0


def at_faces(voxels: DarkVoxels) -> NDArray[np.bool_]:
    """Which voxels (N,) lie at the faces of their grid."""
    indices = voxels.indices
    return np.asarray(np.any((indices == 0) | (indices == np.array(voxels.grid.shape) - 1), axis=1))
