"""What came of runs: volumes and their parts, droplets, statistics.

It may import what ``server.web.api`` may.
"""
