"""Velocities: which droplet of exposure B is which one of exposure A, how fast it flew, and tracks over many shots.

Pure functions on arrays and frozen values, but for ``track_file``. May import ``droplets`` and what lies below it;
``figures``, ``studies`` and ``runs`` import it.
"""
