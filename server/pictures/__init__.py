"""Pictures for people: frames, slices, surfaces, timing. Arrays in, bytes out; previews lie beside their volumes.

They may import ``rig``, ``processing`` and ``daq``.
"""
