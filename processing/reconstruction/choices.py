"""What a user chooses: method, accuracy and type of voxels. Free of numpy and pydantic, so that it loads at once."""

from enum import StrEnum


class ReconstructionMethod(StrEnum):
    """How the intensities that the views see at a voxel become its intensity."""

    GAVLOS = "gavlos"
    """Geometric average."""
    MINLOS = "minlos"
    """Minimum."""
    MLOS = "mlos"
    """Product."""
    SMART = "smart"
    """Simultaneous multiplicative algebraic reconstruction, started from MLOS."""
    MART = "mart"
    """The same, view by view."""

    @property
    def iterative(self) -> bool:
        """Whether the method projects the volume back onto the images."""
        return self in (ReconstructionMethod.SMART, ReconstructionMethod.MART)


class Accuracy(StrEnum):
    """Pixels per voxel of rectified images; their samples are interpolated linearly."""

    NOMINAL = "nominal"
    """As accurate as linear interpolation of the recorded image: rms errors of droplets are 1.03 to 1.16 times as
    large."""
    FINE = "fine"
    """About twice as accurate (1.8 to 2.6 times), at twice the cost."""

    @property
    def pixels_per_voxel(self) -> float:
        """Of the plane that is nearest to the camera."""
        return 0.95 if self is Accuracy.NOMINAL else 1.5


class VoxelType(StrEnum):
    """How finely the intensity of a voxel is kept; named as numpy names the types that the kernels write."""

    FLOAT32 = "float32"
    FLOAT16 = "float16"
    """11 significant bits, more than most cameras have."""
    UINT8 = "uint8"
    """256 steps."""

    @property
    def computed(self) -> "VoxelType":
        """What the kernels write before it becomes bytes."""
        return VoxelType.FLOAT16 if self is VoxelType.UINT8 else self

    @property
    def unit(self) -> float:
        """Intensity of a voxel of 1, where an intensity of 1 is the largest."""
        return 1 / 255 if self is VoxelType.UINT8 else 1.0
