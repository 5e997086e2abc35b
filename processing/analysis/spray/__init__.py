"""The spray as a whole: what the droplets of many shots say together. Pure functions on columns, and frozen values.

``spray_statistics`` is in front; it may import ``droplets``, and ``runs``, figures, studies and server import it.
"""
