"""The plan of a reconstruction: everything that depends on calibration and grid alone.

It knows geometry, calibrations and kernels; every method takes a ``Plan``.
"""
