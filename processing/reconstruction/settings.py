"""ReconstructionSettings: how shots become volumes. The same frozen value in API, job and result."""

import hashlib
import math
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, field_validator

from processing.preprocessing import Polarity, Preprocessing
from processing.reconstruction.choices import Accuracy, ReconstructionMethod, VoxelType
from processing.volume import VoxelGrid

METHOD_VERSION = 2
"""Of what the numbers in a volume mean; results without one are of version 1.

2: SMART and MART count the path of each line of sight; Keys' kernel resamples images with a = -0.6, not -0.75.
"""


MOST_RELAXATION = 2.0
"""Beyond, SMART diverges."""
MAX_VOXELS = 10**12
"""More fill any disk: a thousand times the largest volume of the paper's rig."""


class FrozenValue(BaseModel):
    """A value: frozen, and a misspelt field is an error."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class GridSettings(FrozenValue):
    """The grid to reconstruct on, see ``processing.volume.VoxelGrid``."""

    shape: Annotated[
        tuple[Annotated[int, Field(ge=1)], Annotated[int, Field(ge=1)], Annotated[int, Field(ge=1)]],
        Field(description="voxels along z, y, x"),
    ]
    origin_mm: Annotated[
        tuple[FiniteFloat, FiniteFloat, FiniteFloat], Field(description="centre of voxel [0, 0, 0], x, y, z")
    ]
    pitch_mm: Annotated[FiniteFloat, Field(gt=0, description="voxel edge")]

    @field_validator("shape")
    @classmethod
    def _fits_a_disk(cls, shape: tuple[int, int, int]) -> tuple[int, int, int]:
        if math.prod(shape) > MAX_VOXELS:
            raise ValueError(f"{' x '.join(map(str, shape))} voxels are too many, limit {MAX_VOXELS:.0e}")
        return shape

    @classmethod
    def of(cls, grid: VoxelGrid) -> "GridSettings":
        """Settings of a grid."""
        return cls(shape=grid.shape, origin_mm=grid.origin_mm, pitch_mm=grid.pitch_mm)

    def to_grid(self) -> VoxelGrid:
        """The same as a VoxelGrid."""
        return VoxelGrid(self.shape, self.origin_mm, self.pitch_mm)


class ReconstructionSettings(FrozenValue):
    """How shots become volumes; travels with every result."""

    method: Annotated[ReconstructionMethod, Field(description="line of sight, fast; or iterative, fewer ghosts")] = (
        ReconstructionMethod.MLOS
    )
    accuracy: Annotated[Accuracy, Field(description="fine: two to three times more accurate, at twice the cost")] = (
        Accuracy.NOMINAL
    )
    voxels: Annotated[
        VoxelType,
        Field(description="how volumes are stored: float16 keeps 11 bits in half the file of float32, uint8 256 steps"),
    ] = VoxelType.FLOAT16
    iterations: Annotated[int, Field(ge=1, le=200, description="of SMART and MART, at most")] = 20
    relaxation: Annotated[
        float, Field(gt=0, le=MOST_RELAXATION, description="exponent of SMART and MART; the paper's is 1")
    ] = 1.0
    least_gain: Annotated[
        float,
        Field(
            ge=0, lt=1, description="SMART and MART stop when an iteration lowers the residual by less than this share"
        ),
    ] = 0.0
    grid: Annotated[GridSettings | None, Field(description="default: what all views see, one voxel per pixel")] = None
    minimum_window_px: Annotated[
        int, Field(ge=0, le=2001, description="sliding minimum, wider than a droplet; 0 leaves it out")
    ] = Preprocessing.minimum_window_px
    noise_floor: Annotated[float, Field(ge=0, lt=1, description="intensity that counts as nothing")] = (
        Preprocessing.noise_floor
    )

    def preprocessing(self, polarity: Polarity) -> Preprocessing:
        """How exposures of a run of this polarity become intensities."""
        return Preprocessing(polarity, self.minimum_window_px, self.noise_floor)

    def results_id(self, calibration: str) -> str:
        """Name of the results directory: method, and a hash of its version, all settings and the calibration's name."""
        digest = hashlib.sha256(f"{calibration}\n{METHOD_VERSION}\n{self.model_dump_json()}".encode()).hexdigest()
        return f"{self.method.value}-{digest[:8]}"
