"""Pictures become a run of the product, with its references, beside the calibration that is believed."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from daq.files.run_directory import DoubleFrame, ExposureRecord, ImageKey, RunHeader, RunWriter, Shot, ViewFormat
from processing.calibration.calibration_file import save_calibration
from tests.hunt.rig import SIZE_PX, Array, believed
from tests.hunt.world import HALF_MM, Pictures, World

_SEEN, _LOST = ExposureRecord(valid=True, frame_id=1, device_timestamp_ns=1), ExposureRecord(valid=False)


def write_world(folder: Path, world: World, pictures: Pictures) -> tuple[Path, Path]:
    """Directory of the run, and file of the calibration."""
    names = [f"view{number + 1}" for number in range(len(world.views))]
    calibration = folder / "calibration.json"
    save_calibration(believed(world.views, HALF_MM + 0.6), calibration)
    header = RunHeader(
        run_id="run",
        created_utc="2026-01-01T00:00:00+00:00",
        views={name: ViewFormat(SIZE_PX[::-1], world.bits) for name in names},
        frames_per_shot=2 if world.exposures == 2 else 1,
        separation_ns=world.stated_ns if world.exposures == 2 else None,
        polarity=world.polarity,
    )
    with RunWriter(folder / "run", header) as writer:
        darks, backgrounds = (_references(names, images, world) for images in (pictures.darks, pictures.backgrounds))
        writer.write_references(darks, backgrounds if world.polarity == "shadow" else {})
        for number in range(len(pictures.shots)):
            writer.write_shot(_shot(number, names, world, pictures))
        writer.finish("completed")
    return folder / "run", calibration


def _shot(number: int, names: list[str], world: World, pictures: Pictures) -> Shot:
    views, whole = {}, True
    for view, name in enumerate(names):
        greys = [grey(image, world.bits) for image in pictures.shots[number, :, view]]
        lost = [(number, exposure, view) in pictures.missing for exposure in range(world.exposures)]
        frames = [np.zeros_like(one) if gone else one for one, gone in zip(greys, lost, strict=True)]
        records = [_LOST if gone else _SEEN for gone in lost]
        pair = (frames[0], frames[1] if len(frames) > 1 else None)
        views[name] = DoubleFrame(*pair, records[0], records[-1] if len(frames) > 1 else _SEEN)
        whole &= not any(lost)
    return Shot(number, ImageKey.SAMPLE if whole else ImageKey.INVALID, views)


def grey(image: Array, bits: int) -> NDArray[Any]:
    """Grey values of an image over the full scale."""
    most = 2**bits - 1
    counts: NDArray[Any] = np.clip(np.rint(most * image), 0, most)
    return counts.astype(np.uint8 if bits == 8 else np.uint16)


def _references(names: list[str], images: Array, world: World) -> dict[str, NDArray[np.float32]]:
    """Means of many images are no whole grey values, yet none is beyond the full scale."""
    most = 2**world.bits - 1
    counts = np.clip(most * images, 0, most).astype(np.float32)
    return {name: np.repeat(image[None], world.exposures, axis=0) for name, image in zip(names, counts, strict=True)}
