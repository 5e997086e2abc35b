"""Droplets of recorded runs: their measurement is asked for here, and their files are told.

May import ``server.lab`` and ``processing``; API and page import it.
"""
