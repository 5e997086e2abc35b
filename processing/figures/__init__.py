"""Every picture of matplotlib, one module per family: arrays and rows in, a Figure out; who wants a file saves it.

It may import everything down to ``analysis``, and computes nothing that is not drawn; studies and server call it.
"""
