"""Opaque discs behind a lens: what they look like in any light, and how they are fitted to images.

It imports nothing of what lies beside this room.
"""
