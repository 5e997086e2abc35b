"""SeenExposure: a volume that the page shows, and whether its slices can be had at full resolution."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from daq.errors import DaqError
from processing.reconstruction.choices import ReconstructionMethod
from processing.reconstruction.volume_part import RangesMm
from server.lab.errors import ServerError
from server.lab.results import part_of, preview_of, volume_file
from server.lab.services import Context
from server.lab.volume_doubts import volume_doubts
from server.pictures.pictures import Colours
from server.pictures.previews import VolumePreview
from server.web.ui.results.looked_at import LookedAt

AXES = ("z", "x", "y")
SHADES = {"a": Colours.BLUE, "b": Colours.RED}
"""Of exposures that are shown one upon the other, and of their surfaces."""


@dataclass(frozen=True, eq=False)
class SeenExposure:
    """One exposure.

    Parameters
    ----------
    frame, name : str
        ``a`` or ``b``, and of its volume.
    folder : str
        Its address in REST.
    file : Path
        Of the volume.
    preview : VolumePreview
        In short.
    doubts : tuple of str
        What speaks against it.
    """

    frame: str
    name: str
    folder: str
    file: Path
    preview: VolumePreview
    doubts: tuple[str, ...] = ()


@dataclass(frozen=True)
class FullSlices:
    """Whether slices can be made at full resolution.

    Parameters
    ----------
    method : ReconstructionMethod | None
        That was asked for; None: the volume's own.
    limits : dict of frame to float
        Intensity of the brightest colour.
    problem : str
        Why not; empty if they can.
    """

    method: ReconstructionMethod | None
    limits: dict[str, float]
    problem: str = ""


def see(context: Context, looked: LookedAt, names: dict[str, str]) -> list[SeenExposure]:
    """Previews of the exposures of a shot, by their names; ServerError if one cannot be read."""
    seen = []
    for frame, name in sorted(names.items()):
        file = volume_file(context.runs.directory(looked.run_id), looked.results_id, name)
        folder = f"/api/runs/{looked.run_id}/results/{looked.results_id}/{name}"
        seen.append(SeenExposure(frame, name, folder, file, preview_of(file), volume_doubts(file)))
    return seen


def try_full(
    context: Context, seen: Sequence[SeenExposure], parts_mm: Sequence[RangesMm], method: ReconstructionMethod | None
) -> FullSlices:
    """Make parts once, so that those that are asked for next are there at once; or say why not."""
    limits = {one.frame: one.preview.limit for one in seen}
    try:
        for one in seen:
            parts = [part_of(context.parts, one.file, context.calibrations, part_mm, method) for part_mm in parts_mm]
            if method is not None:
                limits[one.frame] = max(float(part.voxels.max()) for part in parts) or 1.0
    except (DaqError, ServerError) as error:
        return FullSlices(method, limits, str(error))
    return FullSlices(method, limits)
