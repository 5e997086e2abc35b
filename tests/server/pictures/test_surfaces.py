import json
import struct
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from processing.volume import VoxelGrid
from server.pictures.previews import make_preview
from server.pictures.surfaces import surface_glb


def read_glb(data: bytes) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Faces, positions and normals of a mesh, read by the letter of glTF 2.0."""
    magic, version, length = struct.unpack_from("<4sII", data)
    assert (magic, version, length) == (b"glTF", 2, len(data))
    size, kind = struct.unpack_from("<I4s", data, 12)
    assert (kind, size % 4) == (b"JSON", 0)
    document = json.loads(data[20 : 20 + size])
    binary_size, kind = struct.unpack_from("<I4s", data, 20 + size)
    assert (kind, binary_size % 4) == (b"BIN\0", 0)
    binary = data[28 + size :]
    arrays = []
    for accessor in document["accessors"]:
        view = document["bufferViews"][accessor["bufferView"]]
        numbers = {5125: "<u4", 5126: "<f4"}[accessor["componentType"]]
        part = binary[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]
        arrays.append(np.frombuffer(part, numbers).reshape(-1, 3))
    return arrays[0], arrays[1], arrays[2]


def ball_volume(centre_mm: tuple[float, float, float], grid: VoxelGrid) -> NDArray[np.float32]:
    z, y, x = np.meshgrid(grid.z_mm, grid.y_mm, grid.x_mm, indexing="ij")
    radius = np.sqrt((x - centre_mm[0]) ** 2 + (y - centre_mm[1]) ** 2 + (z - centre_mm[2]) ** 2)
    return np.asarray(np.clip(1 - radius / 4, 0, 1), np.float32)


def test_the_surface_of_a_ball_lies_where_the_ball_does_and_faces_outwards() -> None:
    grid = VoxelGrid.centred((40, 50, 60), 0.25)
    centre_mm = (1.5, -2.0, 0.5)
    volume = ball_volume(centre_mm, grid)
    faces, positions, normals = read_glb(surface_glb(make_preview(volume, grid), 0.5))
    radius_mm = 4 * (1 - 0.5 * volume.max())
    from_centre = positions - np.array(centre_mm) * (1, -1, -1)
    np.testing.assert_allclose(np.linalg.norm(from_centre, axis=1), radius_mm, atol=0.05)
    assert (np.sum(from_centre * normals, axis=1) > 0).all()
    corners = from_centre[faces]
    face_normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (np.sum(face_normals * corners.mean(axis=1), axis=1) >= 0).all()


@pytest.mark.parametrize("value", [0.0, 1.0])
def test_an_empty_and_a_full_volume_have_a_readable_mesh(value: float) -> None:
    grid = VoxelGrid.centred((5, 5, 5), 1.0)
    faces, positions, _ = read_glb(surface_glb(make_preview(np.full((5, 5, 5), value, np.float32), grid), 0.5))
    assert faces.max() < len(positions)
    assert (len(positions) > 3) == (value > 0)
