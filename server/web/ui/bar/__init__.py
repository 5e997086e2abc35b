"""The bar that is always in sight: rig, lamps, state, connection, ABORT, alarms.

Its modules may import ``lab``, ``pictures``, the addresses of REST and what all pages share.
"""
