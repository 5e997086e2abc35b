"""Liquid that is no droplet: connected objects of what all views see dark, their shapes, the break-up length.

Pure functions on arrays. May import ``reconstruction`` and below; ``runs``, ``figures`` and studies import it.
"""
