"""A run of a reticle of dots becomes a calibration of sizes.

May import ``runs`` and what lies below it; commands import it.
"""
