"""The error of reconstruction."""

from processing.errors import BadInput


class ReconstructionError(BadInput):
    """Views, or a grid, from which nothing can be reconstructed; the text names value and limit."""


class RoughMapping(ReconstructionError):
    """A mapping that bends too much within voxels to be sampled; most run away far outside of what was calibrated."""
