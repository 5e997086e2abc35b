"""Velocities: which droplet of exposure B is which one of exposure A, how fast it flew, and tracks over many shots.

Pure functions on arrays and frozen values, but for ``track_file``. May import ``droplets`` and what lies below it;
``figures``, ``studies`` and ``runs`` import it.
"""

HALF_WINDOW = 2
"""Frames before and after a droplet that have a say in its motion: five points smooth noise to a third and blur little.

It stands here because a command tells it in its help, which loads nothing that takes long.
"""
