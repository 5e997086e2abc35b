"""Droplets of one exposure: where they are, how bright, how sure. Pure functions on arrays and frozen values.

What holds for bright particles alone is named so. It may import everything down to ``reconstruction``.
"""
