"""The plan of a reconstruction: everything that depends on calibration and grid alone.

It knows geometry and kernels; every method takes a ``Plan``.
"""
