"""Velocities: which droplet of exposure B is which one of exposure A, and how fast it flew in between.

Pure functions on arrays and frozen values. ``runs`` and the public API call ``velocities``; the other modules are its
parts.
"""
