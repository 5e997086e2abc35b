"""Studies of velocities: how many droplets of a double exposure are paired, how rightly, and how exactly they move.

Their truth, of ``processing.synthetic``, shares no code with the measurement. It may import all that studies may.
"""
