"""Every picture of matplotlib that is not one of a study.

It may import everything down to ``analysis``, and computes nothing that is not drawn.
"""
