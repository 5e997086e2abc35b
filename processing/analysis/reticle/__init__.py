"""A reticle of opaque dots, measured: what the product finds where diameters are known.

May import ``droplets`` and what lies below it; ``runs`` and ``figures`` import it.
"""
