"""ReconstructionMethod: the ways from images to a volume."""

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
