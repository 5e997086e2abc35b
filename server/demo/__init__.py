"""The whole chain once, on the simulated laboratory, and its report.

It may import ``rig``, ``processing`` and ``daq``; the command ``demo`` runs it.
"""
