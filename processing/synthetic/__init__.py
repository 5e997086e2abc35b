"""Synthetic sprays, targets and their views; they feed the tests, the studies and the simulated cameras.

It knows geometry and optics, and nothing of calibration and reconstruction.
"""
