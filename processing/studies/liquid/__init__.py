"""Studies of liquid that is no droplet: break-up length, and classes of objects.

Their truth, of ``processing.synthetic``, shares no code with the measurement. It may import all that studies may.
"""
