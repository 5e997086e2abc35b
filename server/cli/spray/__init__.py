"""Commands on droplets that were measured: statistics of the spray, and the report.

``server/cli/main.py`` imports them; they read the results of ``measure``, and need neither run nor rig.
"""
