"""The operator's page, one module per part of it.

They may import ``lab`` and ``pictures``, not REST.
"""
