"""Peak memory of a whole reconstruction, in a process of its own: ``python -m processing.benchmarks.memory``."""

import json
import subprocess
import sys
from collections import deque
from dataclasses import asdict
from pathlib import Path
from typing import Literal

import numpy as np

from processing.benchmarks.scene import SpeedStudy, sparse_images, spray_images, study_cameras
from processing.reconstruction.line_of_sight import line_of_sight, slabs_of_sight
from processing.reconstruction.planning.plan import plan_reconstruction
from processing.reconstruction.smart import smart

Work = Literal["volume", "slabs", "smart"]
DEADLINE_S = 300.0


def peak_memory_gb(work: Work, study: SpeedStudy) -> float:
    """Most memory that Python, libraries, images, plan and result of one exposure occupied together.

    The result is the whole volume of MLOS in float16, one slab of it after the other, or the filled blocks of SMART.
    """
    command = [sys.executable, "-m", __name__, work, json.dumps(asdict(study))]
    done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True, timeout=DEADLINE_S)
    return float(done.stdout) / 1e9


def _reconstruct(work: str, study: SpeedStudy) -> None:
    cameras = study_cameras(study.image_size_px)
    plan = plan_reconstruction(cameras, study.grid)
    if work == "volume":
        volume = np.empty(study.shape, np.float16)
        line_of_sight(plan, spray_images(study, cameras), out=volume, threads=study.threads)
    elif work == "slabs":
        deque(slabs_of_sight(plan, spray_images(study, cameras), threads=study.threads), maxlen=1)
    else:
        smart(plan, sparse_images(study, cameras), iterations=study.iterations, threads=study.threads)


def _peak_bytes() -> int:
    """Of this program alone; ``ru_maxrss`` would also know the one that started it."""
    lines = dict(line.split(":", 1) for line in Path("/proc/self/status").read_text().splitlines())
    return int(lines["VmHWM"].split()[0]) * 1024


if __name__ == "__main__":
    settings = json.loads(sys.argv[2])
    settings |= {name: tuple(settings[name]) for name in ("shape", "image_size_px")}
    _reconstruct(sys.argv[1], SpeedStudy(**settings))
    sys.stdout.write(str(_peak_bytes()))
