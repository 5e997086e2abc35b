"""What all studies of the command line share, and those too large for ``server/cli/study.py``.

``server/cli/study.py`` alone imports them.
"""
