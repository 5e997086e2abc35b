"""The error of reconstruction."""

from processing.errors import BadInput


class ReconstructionError(BadInput):
    """Views, or a grid, from which nothing can be reconstructed; the text names value and limit."""


class RoughMapping(ReconstructionError):
    """A mapping that voxels of such a width cannot sample; most run away far outside of what was calibrated."""
