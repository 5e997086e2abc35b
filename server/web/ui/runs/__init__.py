"""The page of all runs.

Its modules may import ``lab``, ``pictures``, the addresses of REST and what all pages share.
"""
