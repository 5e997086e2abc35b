"""How droplets are measured, and what of it is for which images."""

import hashlib
from typing import Annotated, Self

from pydantic import Field, model_validator

from processing.analysis.droplets.droplet_search import MARGIN_VOXEL
from processing.analysis.droplets.shadows.light.light_search import Light
from processing.analysis.droplets.size_correction import SizeRows
from processing.preprocessing import Polarity
from processing.reconstruction.settings import FrozenValue, GridSettings
from processing.runs.errors import PipelineError
from processing.runs.liquid.objects import NozzleNumbers
from processing.runs.measured_images import IgnoredPixels
from processing.runs.recipe import recipe_sha256

METHOD_VERSION = 14
"""Of what the numbers in a file of droplets mean."""


class MeasureSettings(FrozenValue):
    """How droplets are measured; travels with every result."""

    polarity: Annotated[Polarity, Field(description="bright particles on black, or shadows")] = "bright"
    grid: Annotated[GridSettings | None, Field(description="default: what all views see, one voxel per pixel")] = None
    margin_voxel: Annotated[int, Field(ge=0, le=500, description="so far around the grid droplets are looked for")] = (
        MARGIN_VOXEL
    )
    twins: Annotated[
        int, Field(ge=0, le=100, description="simulated twins per exposure in which ghosts are counted; 0: none")
    ] = 0
    seed: Annotated[int, Field(ge=0, description="of the twins")] = 0
    light: Annotated[Light, Field(description="of shadows: condenser ratio; incoherent, gaussian or estimated")] = (
        "estimated"
    )
    sizes: Annotated[SizeRows, Field(description="of the dots of a reticle, um: found in this light, true, sd")] = ()
    ignored: Annotated[
        tuple[IgnoredPixels, ...],
        Field(description="rectangles of shadow images that are not asked, VIEW=LEFT:RIGHT,TOP:BOTTOM in px"),
    ] = ()
    nozzle: Annotated[NozzleNumbers | None, Field(description="x, y, z in mm, and axis; default: the run's own")] = None

    @model_validator(mode="after")
    def _sizes_of_one_light(self) -> Self:
        if self.sizes and self.light == "estimated":
            raise ValueError("sizes were found in one light: state it, as size-calibration does")
        return self

    def results_id(self, calibration: str) -> str:
        """Name of the results directory: droplets, and a hash of method, settings and the calibration's name."""
        digest = hashlib.sha256(f"{calibration}\n{recipe_sha256('measure', METHOD_VERSION, self)}".encode()).hexdigest()
        return f"droplets-{digest[:8]}"


def require_measurable(run_name: str, recorded: Polarity, settings: MeasureSettings) -> None:
    """Refuse what cannot be measured, before anything is read.

    Raises
    ------
    PipelineError
        A polarity other than the run's, or settings of shadows for bright particles.
    """
    if settings.polarity != recorded:
        raise PipelineError(
            f"{run_name}: its images are recorded as {recorded}, they are not measured as {settings.polarity}"
        )
    for stated, what in ((settings.ignored, "pixels to ignore are"), (settings.nozzle, "a nozzle is")):
        if recorded == "bright" and stated:
            raise PipelineError(
                f"{what} for shadows: of bright particles all pixels are asked, and nothing hangs together"
            )
    if recorded == "bright" and settings.light != "estimated":
        raise PipelineError(f"light {settings.light} is for shadows: bright particles have no diameter to correct")
