"""Studies of droplets as shadows: how many are found, and how exactly their sizes.

Their truth, of ``processing.synthetic``, shares no code with the measurement. It may import all that studies may.
"""
