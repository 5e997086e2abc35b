"""Liquid that is no droplet in recorded shots: objects of an exposure, break-up length of a run.

Imports what images and grids need; ``measurement`` imports it.
"""
