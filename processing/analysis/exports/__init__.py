"""Tables of droplets as files of other programs: CSV, Parquet, and VTKHDF for ParaView.

May import ``analysis.droplets`` and what lies below it.
"""
