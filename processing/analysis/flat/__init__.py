"""Droplets in single images, in pixels: one view, no calibration, no depth.

Pure functions on arrays. It may import everything down to ``reconstruction``.
"""
