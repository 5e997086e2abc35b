"""Recorded runs: what lies in their directories, for lists and pages, with an index that remembers what was read.

May import ``server.lab`` and ``daq``; the rest of the laboratory, API and page import it.
"""
