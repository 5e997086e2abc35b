"""Commands that keep recorded runs: are they whole, what can be mended, one file of a run.

``server/cli/main.py`` imports them; they look at files alone, and need neither server nor rig.
"""
