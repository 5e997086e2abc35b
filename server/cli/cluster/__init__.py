"""Commands for other computers: their scheduler and workers, and the option of those whose shots they do.

``server/cli/main.py`` imports them; what they run is in ``server/lab/engine/``.
"""
