"""Commands that ask a running server by its API: start a run, list runs, watch one, stop or abort it.

``server/cli/main.py`` imports them. They are thin: what can be asked is in ``tomoshadow.client``.
"""
