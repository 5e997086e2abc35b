"""The live page: pictures of all cameras, live view and single shots.

Its modules may import ``lab``, ``pictures``, the addresses of REST and what all pages share.
"""
