"""The page of volumes and of what was measured in them.

Its modules may import ``lab``, ``pictures``, the addresses of REST and what all pages share.
"""
