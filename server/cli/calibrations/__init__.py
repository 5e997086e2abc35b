"""Commands that make, check or correct a calibration: of views, or of sizes.

``server/cli/main.py`` imports them, and ``runs`` how a check is told.
"""
