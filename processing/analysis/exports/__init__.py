"""Tables of droplets and of tracks as files of other programs: CSV, Parquet, VTKHDF for ParaView, Tecplot.

May import ``analysis.droplets``, ``analysis.velocity`` and what lies below them.
"""
