"""Studies of how probably droplets are told to be real, against their truth.

Bright particles and shadows alike. They may import all that studies may.
"""
