"""The laboratory: runs, calibrations, results and jobs, and the work that goes on by itself.

It knows neither HTTP nor command line; it may import ``pictures``, ``rig``, ``processing`` and ``daq``.
"""
