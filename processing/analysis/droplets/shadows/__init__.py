"""Droplets as shadows: opaque discs under a blur, how they are found, and what they measure.

It may import everything that ``droplets`` may, and ``droplets`` itself; bright particles do not know it.
"""
