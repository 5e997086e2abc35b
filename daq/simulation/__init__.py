"""The simulated laboratory: the other end of every wire. Real drivers always run against it.

It may know the formats of the drivers; of the rest of the product ``server.rig`` alone imports it.
"""
