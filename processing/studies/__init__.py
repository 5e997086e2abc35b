"""The studies of the paper and beyond, one module each: simulate, reconstruct, measure, state.

They may import everything but ``runs``; the command ``study`` runs them.
"""
