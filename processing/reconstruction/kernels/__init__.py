"""The compiled kernels; ``plan``, ``line_of_sight`` and ``smart`` are their callers."""
