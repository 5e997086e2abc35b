"""The other end of every wire, and the ``laboratory`` around them all.

A simulated rig has the real drivers at this end.

It may know the formats of the drivers; of the rest of the product ``server.rig`` alone imports it.
"""
