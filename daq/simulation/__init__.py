"""The other end of every wire, and the ``laboratory`` around them all. Real drivers always run against it.

It may know the formats of the drivers; of the rest of the product ``server.rig`` alone imports it.
"""
