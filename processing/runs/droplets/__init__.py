"""Shots become droplets: how they are measured, and what became of each shot.

It may import what lies beside this room; ``reticle/`` imports it.
"""
