"""The error of reconstruction."""

from processing.errors import BadInput


class ReconstructionError(BadInput):
    """Views, or a grid, from which nothing can be reconstructed; the text names value and limit."""
