"""What droplets of a double exposure say of those that have no partner: alone, or out of the box.

Pure functions on arrays and stored shots. May import ``droplets``; whatever tells doubts of velocities imports it.
"""
