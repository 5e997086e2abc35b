"""The page of the next run and of the one that is going on.

Its modules may import ``lab``, ``pictures``, the addresses of REST and what all pages share.
"""
