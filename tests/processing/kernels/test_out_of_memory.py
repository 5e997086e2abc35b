"""Where memory ends, there is a MemoryError, in whatever thread it ends; the interpreter goes on."""

import subprocess
import sys

import pytest

PROGRAM = """
import resource
import sys
import numpy as np
from processing.geometry import view_camera
from processing.preprocessing import Preprocessing, intensity
from processing.reconstruction.line_of_sight import line_of_sight
from processing.reconstruction.mean_line_of_sight import mean_line_of_sight
from processing.reconstruction.planning.plan import plan_reconstruction
from processing.reconstruction.smart import mart, smart
from processing.volume import VoxelGrid

cameras = [
    view_camera(a, focal_length_mm=85, magnification=0.43, scale_px_per_mm=60, image_size_px=(700, 200))
    for a in (20, -20)
]
grid = VoxelGrid.centred((24, 160, 640), 1 / 60)
plan = plan_reconstruction(cameras, grid)
rng = np.random.default_rng(1)
images = [0.1 + 0.9 * rng.random((200, 700), np.float32) for _ in cameras]
frame = rng.integers(0, 255, (200, 700)).astype(np.uint8)
volume = np.empty(grid.shape, np.float32)
work = {
    "line of sight": lambda: line_of_sight(plan, images, out=volume, threads=4),
    "mean": lambda: mean_line_of_sight(plan, [images] * 3, out=volume, threads=4),
    "smart": lambda: smart(plan, images, iterations=1, threads=4),
    "mart": lambda: mart(plan, images, iterations=1, start=volume, threads=4),
    "intensity": lambda: intensity(frame, Preprocessing(), bits=8, threads=4),
}[sys.argv[1]]
volume.fill(1)
failed = 0
for room in [n * 2**18 for n in (*range(0, 40, 4), *range(40, 240, 20))]:
    with open("/proc/self/statm") as file:
        used = int(file.read().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + room, resource.RLIM_INFINITY))
    try:
        work()
    except MemoryError:
        failed += 1
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
work()
print(failed)
"""


@pytest.mark.parametrize("work", ["line of sight", "mean", "smart", "mart", "intensity"])
def test_memory_that_ends_is_an_error_and_nothing_else(work: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, work], capture_output=True, text=True, timeout=120, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert int(done.stdout) > 0
