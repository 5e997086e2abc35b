"""Synthetic shots of the hollow cone around one height, preprocessed as recorded ones are.

The views look across the spray's axis, so that a few rows of their images hold all that a slab across the axis
casts. Only these rows, and those that the sliding minimum reaches, are rendered.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from processing.geometry import PinholeCamera
from processing.preprocessing import Preprocessing, intensity
from processing.synthetic.liquid.nozzles import HOLLOW_CONE_FLOW
from processing.synthetic.paper_rig import IMAGE_SCALE_PX_PER_MM, paper_cameras, paper_optics
from processing.synthetic.scene import NOMINAL_WIDTH_NS, Scene, SceneKind
from processing.volume import VoxelGrid

Image = NDArray[np.float32]

BITS = 12
REFERENCE_FRAMES = 8
"""Frames that make up the dark and the background image."""
MINIMUM_WINDOW_PX = 201
"""Of the sliding minimum, at full resolution."""


def height_mm(diameters_from_orifice: float) -> float:
    """World y of a height given in orifice diameters d0 below the orifice."""
    flow = HOLLOW_CONE_FLOW
    return flow.orifice_mm[1] + diameters_from_orifice * flow.orifice_diameter_mm


def slab_grid(y_mm: float, radius_mm: float, rows: int, binning: int) -> VoxelGrid:
    """Voxels of one pixel's size around the axis: a square of 2 x ``radius_mm``, an odd number of rows high."""
    pitch_mm = binning / IMAGE_SCALE_PX_PER_MM
    across = 2 * round(radius_mm / pitch_mm) + 1
    half_mm, half_height_mm = across // 2 * pitch_mm, rows // 2 * pitch_mm
    return VoxelGrid((across, rows, across), (-half_mm, y_mm - half_height_mm, -half_mm), pitch_mm)


def cropped_cameras(grid: VoxelGrid, binning: int) -> dict[str, PinholeCamera]:
    """The paper's cameras with the rows of their sensors that see a slab, and half a window more on either side."""
    return {name: _cropped(camera, grid, binning) for name, camera in paper_cameras(binning).items()}


def _cropped(camera: PinholeCamera, grid: VoxelGrid, binning: int) -> PinholeCamera:
    corners = np.array([[x, y, z] for x in grid.x_mm[[0, -1]] for y in grid.y_mm[[0, -1]] for z in grid.z_mm[[0, -1]]])
    rows_px = camera.project(corners)[:, 1]
    margin_px = MINIMUM_WINDOW_PX // binning // 2 + 4
    first = max(0, int(rows_px.min()) - margin_px)
    end = min(camera.image_size_px[1], int(np.ceil(rows_px.max())) + margin_px + 1)
    matrix = camera.camera_matrix.copy()
    matrix[1, 2] -= first
    return replace(camera, camera_matrix=matrix, image_size_px=(camera.image_size_px[0], end - first))


def hollow_cone_images(
    cameras: Mapping[str, PinholeCamera], shots: int, binning: int, seed: int = 0
) -> Iterator[list[Image]]:
    """Preprocessed images of one view after the other, shot by shot: noise, dust and uneven light included.

    Parameters
    ----------
    cameras : Mapping[str, PinholeCamera]
        By view, with the names of the paper's rig.
    shots : int
        Each of its own realisation of the spray.
    binning : int
        Of the cameras.
    seed : int
        Of spray, dust and noise.

    Yields
    ------
    list of (rows, columns) float32 arrays
        0 where a view is free, 1 where it is blocked.
    """
    scene = Scene(cameras, paper_optics(binning), seed=seed, cache_mb=0)
    dark, background = (_references(scene, kind) for kind in (SceneKind.DARK, SceneKind.BACKGROUND))
    settings = Preprocessing(minimum_window_px=MINIMUM_WINDOW_PX // binning)
    scene.prepare(SceneKind.SAMPLE)
    for shot in range(shots):
        yield [
            intensity(_exposed(scene, view, shot), settings, bits=BITS, dark=dark[view], background=background[view])
            for view in cameras
        ]


def _references(scene: Scene, kind: SceneKind) -> dict[str, Image]:
    scene.prepare(kind)
    return {
        view: np.mean([_exposed(scene, view, frame) for frame in range(REFERENCE_FRAMES)], axis=0, dtype=np.float32)
        for view in scene.cameras
    }


def _exposed(scene: Scene, view: str, sequence: int) -> NDArray[np.uint16]:
    """Exposure A of a shot with one pulse of the paper's current."""
    width_px, height_px = scene.cameras[view].image_size_px
    pulse = (0, NOMINAL_WIDTH_NS, scene.optics[view].nominal_current_a)
    frame = scene.render(view, sequence, "A", [pulse], (height_px, width_px), BITS)
    return np.asarray(frame, dtype=np.uint16)
