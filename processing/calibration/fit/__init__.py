"""The models of a camera and their fits, health and placement.

Pure; it knows the targets and the values of ``processing.calibration``, no images.
"""
