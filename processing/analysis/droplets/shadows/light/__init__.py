"""From how many directions light comes, by what droplets look like in it: searched, and what speaks against it.

It may import what lies beside this room; the finder and the verdict of shadows import it.
"""
