"""A run of droplets seen by four views, one of which has moved since it was calibrated."""

from collections.abc import Callable, Container, Iterable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from daq.files.run_directory import DoubleFrame, ExposureRecord, ImageKey, RunHeader, RunWriter, Shot, ViewFormat
from processing.studies.seen_droplets import droplet_image
from processing.synthetic.stamping import FloatImage
from tests.support.drifting_views import DENSITY_PER_MM3, HALF_MM, SIZE_PX, views

SEEN = ExposureRecord(valid=True, frame_id=1, device_timestamp_ns=1)
DRIFT_PX = 2


def rig_of(views: Iterable[str], magnification: float) -> dict[str, Any]:
    """What a header keeps of a rig whose lenses magnify so much."""
    optics = {"lens": {"magnification": magnification}, "sensor": {"pixel_pitch_um": 7.4}}
    return {"views": dict.fromkeys(views, optics)}


def write_droplet_run(
    run_dir: Path,
    density_per_mm3: float = DENSITY_PER_MM3,
    view_count: int = 4,
    covered: str = "",
    *,
    drift_px: int = DRIFT_PX,
    mirrored: bool = False,
    interlaced: bool = False,
    shots: int = 2,
    drifting: Container[int] = range(100),
    cut_px: int = 0,
    odd: Mapping[int, Callable[[FloatImage], FloatImage]] = MappingProxyType({}),
    magnification: float | None = None,
) -> Path:
    """Shots; in those that drift, view2's picture lies two pixels further right than when it was calibrated.

    A covered view is dark; mirrored are all of them. Odd rows of interlaced ones show the droplets 0.1 mm beside.
    Images from elsewhere were cut so many rows lower than those of the target. In odd shots view2 is changed.
    The rig may state the magnification of its lenses.
    """
    rng = np.random.default_rng(11)
    cameras = {f"view{number}": camera for number, camera in enumerate(views()[:view_count], start=1)}
    shape = (SIZE_PX[1], SIZE_PX[0])
    header = RunHeader(
        run_id=run_dir.name,
        created_utc="2026-01-01T00:00:00+00:00",
        views={name: ViewFormat(shape, 8) for name in cameras},
        polarity="bright",
        separation_ns=6400,
        configuration=(cut_px and {"import": {"manifest": "cut.toml"}})
        or (magnification and rig_of(cameras, magnification))
        or {},
    )
    with RunWriter(run_dir, header) as writer:
        for index in range(shots):
            exposures = []
            for _ in "ab":
                points_mm = rng.uniform(-HALF_MM, HALF_MM, (int(density_per_mm3 * np.prod(2 * HALF_MM)), 3))
                images = {name: droplet_image(camera, points_mm, rng) for name, camera in cameras.items()}
                if interlaced:
                    later_mm = points_mm + (0.1, 0, 0)
                    for name, camera in cameras.items():
                        images[name][1::2] = droplet_image(camera, later_mm, rng)[1::2]
                images["view2"] = odd.get(index, np.asarray)(images["view2"])
                images["view2"] = np.roll(images["view2"], drift_px * (index in drifting), axis=1)
                images = {name: np.roll(image, -cut_px, axis=0) for name, image in images.items()}
                images = {name: image[:, ::-1] if mirrored else image for name, image in images.items()}
                images = {name: image * (name != covered) for name, image in images.items()}
                exposures.append({name: np.round(200 * image).astype(np.uint8) for name, image in images.items()})
            shot_views = {name: DoubleFrame(exposures[0][name], exposures[1][name], SEEN, SEEN) for name in cameras}
            writer.write_shot(Shot(index, ImageKey.SAMPLE, shot_views))
        writer.finish("completed")
    return run_dir
