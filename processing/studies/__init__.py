"""The studies of the paper and beyond: simulate, reconstruct, measure, state; ``figures`` draws what they found.

They may import everything but ``runs``; the command ``study`` runs them.
"""
