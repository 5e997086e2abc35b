"""Results of ``tomoshadow measure`` on the disk, read as sprays: their shots, nozzle and axis, and what they share.

Commands and server import it; it may import everything of ``processing`` but studies and benchmarks, and ``daq.files``.
"""
