"""The operator's page, one module per part of it.

They may import ``lab``, ``pictures`` and the addresses of REST.
"""
