"""The operator's desk: ``page.py`` puts it together, ``rail.py`` lists its pages, a room for each of them.

They may import ``lab``, ``pictures`` and the addresses of REST.
"""
