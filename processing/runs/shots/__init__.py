"""A shot on its way: its images, the slabs of its volumes, what became of it.

It may import what lies beside this room, but for what reconstructs, measures or checks whole runs.
"""
