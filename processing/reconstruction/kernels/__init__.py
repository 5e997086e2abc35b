"""The compiled kernels; ``plan``, ``line_of_sight`` and ``smart`` are their callers."""

DEFAULT_THREADS = 2
"""Of work that runs beside an acquisition or another worker; who has the machine to himself says more."""
