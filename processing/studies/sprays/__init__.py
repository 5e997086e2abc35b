"""Studies of the statistics of sprays: droplets are sampled directly, and the truth is a formula.

It may import what ``studies`` may; ``tomoshadow study`` calls it.
"""
