"""Images of a single view become droplets in pixels, in the files that droplets in space have.

May import ``runs`` and what lies below it; commands import it.
"""
