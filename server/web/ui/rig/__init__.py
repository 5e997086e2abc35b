"""The page of the rig: its devices, one by one.

Its modules may import ``lab``, ``pictures``, the addresses of REST and what all pages share.
"""
