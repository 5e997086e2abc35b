"""Bright particles on black, seen by the cameras of ``droplet_run``, as files that somebody else recorded."""

from pathlib import Path

import numpy as np
import tifffile
from numpy.typing import NDArray

from tests.support.droplet_run import DROPLETS_A_MM, SHAPE, cameras


def particle_image(view: str, largest: float, shot: int = 0) -> NDArray[np.float64]:
    """Image of one view (row, column), at most as bright as that; each shot lies 0.1 mm further along y."""
    row, column = np.mgrid[: SHAPE[0], : SHAPE[1]]
    image = np.zeros(SHAPE)
    for u, v in cameras()[view].project(DROPLETS_A_MM + (0, 0.1 * shot, 0)):
        image += np.exp(-((column - u) ** 2 + (row - v) ** 2) / 4)
    scaled: NDArray[np.float64] = np.round(largest * image / image.max())
    return scaled


def write_particles(folder: Path, largest: int, dtype: type[np.uint8] | type[np.uint16], shots: int = 1) -> str:
    """Write ``VIEW/0000.tif`` and so on below a folder; the entry of the manifest that states them one by one."""
    lines = []
    for shot in range(shots):
        for view in cameras():
            (folder / view).mkdir(parents=True, exist_ok=True)
            tifffile.imwrite(folder / view / f"{shot:04d}.tif", particle_image(view, largest, shot).astype(dtype))
        files = ", ".join(f'{view} = "{view}/{shot:04d}.tif"' for view in cameras())
        lines.append(f"[[run.shot]]\nframe_a = {{ {files} }}\n")
    return "\n".join(lines)
