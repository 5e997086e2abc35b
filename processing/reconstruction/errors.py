"""The error of reconstruction."""


class ReconstructionError(Exception):
    """Views, or a grid, from which nothing can be reconstructed; the text names value and limit."""
