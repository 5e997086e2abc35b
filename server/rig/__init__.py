"""The rig of a configuration: its devices, real or simulated, and what follows from its figures alone.

Of concrete devices ``assembly`` alone names the drivers, and ``far_ends`` the simulated ones; it may import
``processing`` and ``daq``.
"""
