"""What casts doubt on the droplets of an exposure, one reason a module; an exposure comes back with its verdict.

It may import what lies beside this room; what measures bright particles and shadows imports it.
"""
