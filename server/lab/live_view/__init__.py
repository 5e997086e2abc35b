"""The newest shot, for people who look: ``live_feed.py`` makes its pictures, the others what can be read off it.

They may import ``pictures`` and the pure parts of ``processing``; what starts light lives in ``starting``.
"""
