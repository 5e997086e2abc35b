"""What touches the disk: importing, shots that become volumes or droplets, checks, and the files of results.

It may import everything of ``processing`` but studies and benchmarks, and ``daq.files``.
"""
