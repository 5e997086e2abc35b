"""Iso-surfaces of previews as binary glTF (GLB), the format that browsers and Blender load. Pure: arrays in, bytes out.

The mesh is in mm with the axes of the world turned for viewers that have y up: (x, -y, -z), a proper rotation.
"""

# mypy: allow-untyped-calls
# scikit-image is typed in parts only.

import json
import struct
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from skimage.measure import marching_cubes

from processing.volume import VoxelGrid
from server.pictures.previews import VolumePreview, make_preview

_LONGEST_AXIS = 112  # keeps a dense spray below about 10 MB
_ELEMENT_ARRAY_BUFFER, _ARRAY_BUFFER = 34963, 34962  # glTF 2.0, section 5.11.5
_FLOAT, _UINT = 5126, 5125  # glTF 2.0, section 3.6.2.2
BLUE, RED = (0.03, 0.2, 0.75, 1.0), (0.75, 0.06, 0.03, 1.0)
"""Linear light, with opacity: of exposures A and B."""
Colour = tuple[float, float, float, float]

Array = NDArray[Any]


def surface_glb(preview: VolumePreview, level: float, colour: Colour = BLUE) -> bytes:
    """GLB file with the surface where the volume has a value.

    Parameters
    ----------
    preview : VolumePreview
        The volume.
    level : float
        Fraction of the largest value, 0 < level < 1.
    colour : tuple of float
        Red, green, blue as linear light, and opacity.

    Returns
    -------
    bytes
        A mesh without triangles if nothing reaches the level.
    """
    coarse = make_preview(preview.voxels, preview.grid, _LONGEST_AXIS)
    closed = np.pad(coarse.voxels, 1)  # surfaces that leave the volume are closed at its faces
    if closed.max() <= 255 * level:
        return glb(np.zeros((3, 3), np.float32), np.zeros((3, 3), np.float32), np.array([[0, 1, 2]]), colour)
    corners, faces, normals, _ = marching_cubes(closed, 255 * level)
    return glb(_to_viewer_mm(corners - 1, coarse.grid), normals[:, ::-1] * (1, -1, -1), faces, colour)


def glb(positions: Array, normals: Array, faces: Array, colour: Colour = BLUE) -> bytes:
    """Binary glTF 2.0 of one mesh; positions and normals (N, 3), faces (M, 3) indices."""
    parts = [faces.astype("<u4").tobytes(), positions.astype("<f4").tobytes(), normals.astype("<f4").tobytes()]
    document = json.dumps(_document(positions, faces.size, list(map(len, parts)), colour))
    chunks = _chunk(b"JSON", document.encode(), b" ") + _chunk(b"BIN\0", b"".join(parts), b"\0")
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def _document(positions: Array, indices: int, lengths_byte: Sequence[int], colour: Colour) -> dict[str, Any]:
    """What glTF says of a mesh, whose indices, positions and normals follow each other in one buffer."""
    offsets = np.cumsum([0, *lengths_byte]).tolist()
    targets = (_ELEMENT_ARRAY_BUFFER, _ARRAY_BUFFER, _ARRAY_BUFFER)
    return {
        "asset": {"version": "2.0", "generator": "tomoshadow"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"indices": 0, "attributes": {"POSITION": 1, "NORMAL": 2}, "material": 0}]}],
        "materials": [
            {
                "pbrMetallicRoughness": {"baseColorFactor": colour, "metallicFactor": 0.0, "roughnessFactor": 0.6},
                "doubleSided": True,
            }
        ],
        "buffers": [{"byteLength": offsets[-1]}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": offset, "byteLength": length, "target": target}
            for offset, length, target in zip(offsets, lengths_byte, targets, strict=False)
        ],
        "accessors": [
            {"bufferView": 0, "componentType": _UINT, "count": indices, "type": "SCALAR"},
            {
                "bufferView": 1,
                "componentType": _FLOAT,
                "count": len(positions),
                "type": "VEC3",
                "min": positions.min(axis=0).tolist(),
                "max": positions.max(axis=0).tolist(),
            },
            {"bufferView": 2, "componentType": _FLOAT, "count": len(positions), "type": "VEC3"},
        ],
    }


def _chunk(kind: bytes, content: bytes, padding: bytes) -> bytes:
    content += padding * (-len(content) % 4)
    return struct.pack("<I4s", len(content), kind) + content


def _to_viewer_mm(indices: Array, grid: VoxelGrid) -> Array:
    points_mm = grid.to_mm(indices.astype(np.float64))
    return np.asarray((points_mm * (1, -1, -1)).astype(np.float32))
