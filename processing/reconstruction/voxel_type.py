"""VoxelType: how finely the intensities of a volume are told apart."""

from enum import StrEnum


class VoxelType(StrEnum):
    """How finely the intensity of a voxel is kept; named as numpy names the types that the kernels write."""

    FLOAT32 = "float32"
    FLOAT16 = "float16"
    """11 significant bits, more than most cameras have."""
    UINT8 = "uint8"
    """256 steps."""

    @property
    def unit(self) -> float:
        """Intensity of a voxel of 1, where an intensity of 1 is the largest."""
        return 1 / 255 if self is VoxelType.UINT8 else 1.0
