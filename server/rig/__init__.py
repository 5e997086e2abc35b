"""The rig of a configuration: its devices, real or simulated, and what follows from its figures alone.

``assembly`` is the only module that names concrete devices; it may import ``processing`` and ``daq``.
"""
