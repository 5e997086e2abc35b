"""What touches the disk: importing, the pipeline from shots to volumes, means, checks, and the files of results.

It may import everything of ``processing`` but studies and benchmarks, and ``daq.files``.
"""
